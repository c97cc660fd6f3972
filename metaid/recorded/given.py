"""What a user says of logs: options, how logs are meant by them, and options that mend what is wrong beside these."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from metaid.models import Array
from metaid.recorded.reading.readings import LogRun

ALL = "all"
DIGITS = {"scale": ".3g", "zero": ".4f"}


@dataclass(frozen=True)
class Option:
    """An option of `metaid estimate`.

    Attributes:
        name: of the option.
        value: what it is given; of a `scale` and a `zero` the joint, or ALL.
        number: of these two, in rad of a `zero`.
        is_undone: whether the option is to be left out.
    """

    name: str
    value: str
    number: float = 0.0
    is_undone: bool = False

    def __str__(self) -> str:
        number = f"={self.number:{DIGITS[self.name]}}" if self.name in DIGITS else ""
        return f"{'no ' if self.is_undone else ''}--{self.name} {self.value}{number}"

    @property
    def of(self) -> tuple[str, str]:
        """What it mends: two that mend the same are one. Gravity, order and angles against the base are one thing."""
        return self.name, "" if self.name in ("gravity", "absolute", "order") else self.value


Advice = tuple[str | tuple[Option, ...], ...]  # a sentence, with the options in it that mend something at once


def told(advice: Iterable[str | tuple[Option, ...]]) -> str:
    """An advice as text."""
    return "".join(each if isinstance(each, str) else " ".join(map(str, each)) for each in advice)


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

    def meant(self, record: LogRun) -> LogRun:
        """A log as it is meant."""
        shifted = replace(record, angles=record.angles + self.zero, torques=record.torques * self.scale)
        return shifted.mapped(lambda read: read * self.signs)

    def beside(self, advice: Advice) -> Advice:
        """The advice with options that mend logs as they are, in place of those that mend logs as they are meant."""
        return tuple(
            each if isinstance(each, str) else tuple(whole for option in each for whole in self._whole(option))
            for each in advice
        )

    def _whole(self, option: Option) -> tuple[Option, ...]:
        if option.name == "scale" and (self.scale != 1.0).any():
            return self._by_joint(option, self.scale * option.number)
        if option.name == "zero" and ((self.zero != 0.0) | (self.signs < 0.0)).any():
            zero = self.zero + self.signs * option.number
            return self._by_joint(option, (zero - 2.0 * np.pi * np.round(zero / (2.0 * np.pi))).round(4))
        is_turned = option.name == "reversed" and self.signs[self.joints.index(option.value)] < 0.0
        return (replace(option, is_undone=is_turned),)

    def _by_joint(self, option: Option, numbers: Array) -> tuple[Option, ...]:
        """The option for its joint, or for all, with the numbers of joints (njoint)."""
        chosen = dict(zip(self.joints, (numbers + 0.0).tolist(), strict=True))
        if option.value != ALL:
            chosen = {option.value: chosen[option.value]}
        elif len(set(chosen.values())) == 1:
            chosen = {ALL: chosen[self.joints[0]]}
        return tuple(replace(option, value=joint, number=number) for joint, number in chosen.items())
