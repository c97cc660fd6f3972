"""Faults that would explain what an estimate does not: each is tried as an unknown beside the lumps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from metaid.estimation.estimate import Estimate, fit
from metaid.estimation.faults import FoundFaults, SearchedFaults
from metaid.estimation.noisy.readings import Readings
from metaid.models import Array
from metaid.plant import FAULT_UNITS

# The next only where those before explain nothing.
TRIED = (("delay",), ("tilt",), ("viscous",), ("spring",), ("delay", "tilt"))
LUMP_OF = {"viscous": "damping"}  # friction that is searched as a lump is not tried
NAMES = {
    "delay": "a delay of",
    "tilt": "a tilt of",
    "viscous": "viscous friction of up to",
    "spring": "springs of up to",
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
        named = " and ".join(f"{NAMES[kind]} {size}" for kind, size in zip(self.kinds, self.sizes, strict=True))
        wanted = ", ".join(f'"{kind}"' for kind in self.all_kinds)
        fall = f"the misfit falls from {self.before:.3g} to {self.after:.2g}"
        return f"with {named} {fall}: set [estimate] faults = [{wanted}]"


def proposed_faults(
    readings: Readings, estimate: Estimate, search: Callable[[tuple[str, ...]], SearchedFaults], declared: float
) -> Proposal | None:
    """The faults that explain what an `estimate` of some `readings` does not; None where none of those tried does.

    Args:
        readings: of all trials.
        estimate: of them.
        search: makes faults of given kinds unknown.
        declared: the delay in s that the torques of the trials have already.
    """
    known = readings.faults.kinds
    for kinds in TRIED:
        searched = {*known, *readings.unknowns.kinds}
        if searched & {*kinds, *(LUMP_OF.get(kind, kind) for kind in kinds)} or ("tilt" in kinds and "offset" in known):
            continue
        wanted = tuple(kind for kind in FAULT_UNITS if kind in (*known, *kinds))
        try:
            found = fit(replace(readings, faults=search(wanted)), _begin(estimate, search(wanted)), 0, gives_up=True)
        except ValueError:
            continue
        if found.is_explained and found.faults is not None:
            sizes = tuple(_size(kind, found.faults, declared if kind == "delay" else 0.0) for kind in kinds)
            return Proposal(kinds, sizes, estimate.misfit, found.misfit, wanted)
    return None


def _begin(estimate: Estimate, searched: SearchedFaults) -> Array:
    """The unknowns (nunknown) of an `estimate`, with none of the faults that it has not `searched`."""
    own = estimate.faults
    found = {} if own is None else dict(zip(own.searched.names, own.unknowns.tolist(), strict=True))
    faults = [found.get(name, 0.0) for name in searched.names]
    return np.asarray(np.append(estimate.log_factors, faults), dtype=np.float64)


def _size(kind: str, found: FoundFaults, declared: float) -> str:
    """The largest fault of a `kind` among those `found`, in words, with what of it is `declared`, in its unit."""
    own = [value for name, value in zip(found.searched.names, found.values.tolist(), strict=True) if kind in name]
    value, unit = max(own, key=abs) + declared, FAULT_UNITS[kind]
    return f"{1e3 * value:.2g} {IN_THOUSANDTHS[unit]}" if unit in IN_THOUSANDTHS else f"{value:.2g} {unit}"
