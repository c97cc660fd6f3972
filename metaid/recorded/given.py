"""What a user says of logs: how they are meant, and advice beside it, whose options say the whole of what to give."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

from metaid.models import Array
from metaid.recorded.reading.readings import Record


@dataclass(frozen=True)
class Given:
    """What the user has said of the logs.

    Attributes:
        joints: their names (njoint).
        scale: what torques are multiplied with (njoint).
        zero: what is added to angles (njoint), in rad or m.
        signs: −1 of joints that count the other way, all three kinds of them, else 1 (njoint).
    """

    joints: tuple[str, ...]
    scale: Array
    zero: Array
    signs: Array

    def meant(self, record: Record) -> Record:
        """A log as it is meant."""
        speeds = None if record.speeds is None else record.speeds * self.signs
        angles, torques = (record.angles + self.zero) * self.signs, record.torques * self.scale * self.signs
        return replace(record, angles=angles, speeds=speeds, torques=torques)

    def whole(self, text: str) -> str:
        """A text whose `--scale`, `--zero` and `--reversed` mend logs as they are meant, with those that mend them as
        they are.
        """
        names = "|".join(map(re.escape, sorted((*self.joints, "all"), key=len, reverse=True)))
        number = r"(-?\d+(?:\.\d+)?(?:e[+-]?\d+)?)"
        text = re.sub(rf"--scale ({names})={number}", self._scaled, text)
        text = re.sub(rf"--zero ({names})={number}", self._shifted, text)
        turned = [joint for joint, sign in zip(self.joints, self.signs, strict=True) if sign < 0.0]
        again = "|".join(map(re.escape, turned))
        return re.sub(rf"(?=--reversed ({again})(?![\w-]))", "no ", text) if turned else text

    def _scaled(self, option: re.Match[str]) -> str:
        whole = self.scale * float(option[2])
        return self._option("scale", option[1], whole, ".3g") if (self.scale != 1.0).any() else option[0]

    def _shifted(self, option: re.Match[str]) -> str:
        whole = self.zero + self.signs * float(option[2])
        whole = (whole - 2.0 * np.pi * np.round(whole / (2.0 * np.pi))).round(4)
        is_other = (self.zero != 0.0).any() or (self.signs < 0.0).any()
        return self._option("zero", option[1], whole, ".4f") if is_other else option[0]

    def _option(self, what: str, name: str, values: Array, digits: str) -> str:
        """The option for the joint of this name, or for all."""
        chosen = dict(zip(self.joints, (values + 0.0).tolist(), strict=True))
        if name != "all":
            chosen = {name: chosen[name]}
        elif len(set(chosen.values())) == 1:
            chosen = {"all": chosen[self.joints[0]]}
        return " ".join(f"--{what} {joint}={value:{digits}}" for joint, value in chosen.items())
