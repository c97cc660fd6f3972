"""Faults that explain what an estimate does not: proposed to the user, or taken up by the study itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from metaid.estimation.faults.searched import FoundFaults
from metaid.models import Array
from metaid.plant import FAULT_UNITS

NAMES = {
    "delay": "a delay of",
    "lag": "a torque lag of",
    "tilt": "a tilt of",
    "offset": "encoder offsets of up to",
    "viscous": "viscous friction of up to",
    "dry": "dry friction of up to",
    "presliding": "pre-sliding over",
    "spring": "springs of up to",
    "bias": "constant torques of up to",
    "cogging": "cogging of up to",
    "rotor": "rotors of up to",
    "gain": "gains of the motors of",
    "limit": "motors that give at most",
}
IN_THOUSANDTHS = {"s": "ms", "rad": "mrad"}


@dataclass(frozen=True)
class Proposal:
    """Faults of some `kinds` that explain what was seen: their sizes in words, and the misfit `before` and `after`;
    `all_kinds` are those that a study should search, with those that it has searched already.
    """

    kinds: tuple[str, ...]
    sizes: tuple[str, ...]
    before: float
    after: float
    all_kinds: tuple[str, ...]

    @property
    def description(self) -> str:
        """What the misfit would be, and what to set, in a sentence."""
        wanted = ", ".join(f'"{kind}"' for kind in self.all_kinds)
        fall = f"the misfit falls from {self.before:.3g} to {self.after:.2g}"
        return f"with {named_faults(self.kinds, self.sizes)} {fall}: set [estimate] faults = [{wanted}]"


@dataclass(frozen=True)
class TakenUp:
    """What speaks for and against faults that were taken up.

    Attributes:
        kinds: of the faults.
        sizes: theirs, in words.
        before: the misfit without them.
        after: the misfit with them.
        rivals: others that explain as much, in words, each with a lump that would be elsewhere.
        shifts: by how much unknowns would change with each of them, and with what they hide (n x nunknown).
    """

    kinds: tuple[str, ...]
    sizes: tuple[str, ...]
    before: float
    after: float
    rivals: tuple[str, ...]
    shifts: Array

    @property
    def description(self) -> str:
        """What was taken up and why, and what else would do, in a sentence."""
        named = named_faults(self.kinds, self.sizes)
        fall = f"the study took up {named}: with that the misfit falls from {self.before:.3g} to {self.after:.2g}"
        if not self.rivals:
            return fall
        return (
            f"{fall}, as it does with {', or '.join(self.rivals)}: intervals hold both, so name in [estimate] faults "
            "what is there"
        )


def fault_sizes(kinds: Sequence[str], found: FoundFaults, declared: float = 0.0) -> tuple[str, ...]:
    """The largest fault of each of these `kinds` among those `found`, in words, with the delay in s that was `declared`
    besides.
    """
    return tuple(_size(kind, found, declared if kind == "delay" else 0.0) for kind in kinds)


def _size(kind: str, found: FoundFaults, declared: float) -> str:
    """The largest fault of a `kind` among those `found`, in words, with what of it is `declared`, in its unit."""
    own, about = found.values[found.searched.are(kind)].tolist(), 1.0 if kind == "gain" else 0.0
    value, unit = max(own, key=lambda each: abs(each - about)) + declared, FAULT_UNITS[kind]
    if kind == "cogging":
        amplitude = float(np.hypot(*np.reshape(own, (2, -1))).max())
        return f"{amplitude:.2g} N m, {found.searched.teeth} times a turn"
    if kind == "limit":
        return f"{min(own):.3g} N m"
    if unit == "1":
        return f"{value:.3g}"
    return f"{1e3 * value:.2g} {IN_THOUSANDTHS[unit]}" if unit in IN_THOUSANDTHS else f"{value:.2g} {unit}"


def named_faults(kinds: Sequence[str], sizes: Sequence[str]) -> str:
    """Faults of these `kinds` with their `sizes`, in words."""
    return " and ".join(f"{NAMES[kind]} {size}" for kind, size in zip(kinds, sizes, strict=True))
