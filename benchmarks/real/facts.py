"""Facts that are made wrong in a log, one by one: is each named with its option, and does the option mend the model?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import metaid

QUARTER, DOWN = 0.5 * np.pi, (0.0, 0.0, -9.81)


@dataclass(frozen=True)
class Wrong:
    """Something wrong: what, how it begins what metaid is to name, and what mends it.

    Attributes:
        what: in words.
        option: how the option begins that is to be named.
        scale: what the torques of each joint are multiplied with (njoint).
        zero: what is added to the angles of each joint (njoint), in rad.
        gravity: what metaid is told of it; None for the robot's own.
        order: which joint's columns stand where those of each should (njoint), from 0 on; None: its own.
    """

    what: str
    option: str
    scale: np.ndarray
    zero: np.ndarray
    gravity: tuple[float, ...] | None = None
    order: tuple[int, ...] | None = None

    def made(self, frame: pd.DataFrame) -> pd.DataFrame:
        """The log with it."""
        bad = frame.copy()
        for joint, (factor, offset) in enumerate(zip(self.scale, self.zero, strict=True), 1):
            bad[f"torque_{joint}"] *= factor
            bad[f"angle_{joint}"] += offset
        if self.order is None:
            return bad
        kinds = {str(column).rpartition("_")[0] for column in bad} - {""}
        moved = {f"{kind}_{i}": bad[f"{kind}_{own + 1}"] for kind in kinds for i, own in enumerate(self.order, 1)}
        return bad.assign(**moved)

    def mending(self, names: Sequence[str]) -> Mapping[str, Any]:
        """What `metaid.estimate` is told by the option, numbers as the user knows them."""
        return {
            "scale": dict(zip(names, (1.0 / self.scale).tolist(), strict=True)),
            "zero": dict(zip(names, (-self.zero).tolist(), strict=True)),
            "gravity": None if self.gravity is None else DOWN,
            "order": None if self.order is None else [names[joint] for joint in self.order],
        }


def wrongs(names: Sequence[str], gains: np.ndarray) -> Iterator[Wrong]:
    """All that issue 28 asks of an arm whose torques are currents times `gains` (njoint), in N m/A."""
    ones, none = np.ones(len(names)), np.zeros(len(names))

    def one(joint: int, value: float) -> np.ndarray:
        return np.where(np.arange(len(names)) == joint, value, 1.0)

    for joint, name in enumerate(names):
        yield Wrong(f"sign of {name}", f"--scale {name}=-1", one(joint, -1.0), none)
        yield Wrong(f"mN m of {name}", f"--scale {name}=", one(joint, 1000.0), none)
        yield Wrong(f"current of {name}", f"--scale {name}=", one(joint, 1.0 / gains[joint]), none)
        yield Wrong(f"zero of {name} by 90°", f"--zero {name}=-1.5708", ones, one(joint, 1.0 + QUARTER) - ones)
    yield Wrong("sign of all", "--scale all=-1", -ones, none)
    yield Wrong("mN m of all", "--scale all=", 1000.0 * ones, none)
    yield Wrong("currents of all", "--scale all=", 1.0 / gains, none)
    yield Wrong("gravity along y", "--gravity 0,0,-9.8", ones, none, (0.0, -9.81, 0.0))
    spelled = sorted(names)
    order = tuple(names.index(name) for name in spelled)
    yield Wrong("joints by the alphabet", f"--order {','.join(spelled)}", ones, none, order=order)


def rows_of(frame: pd.DataFrame, robot: Path, names: Sequence[str], gains: np.ndarray) -> Iterator[dict[str, str]]:
    """Of each what was named, and what share of the right model's intervals of 95 % holds the mended model."""
    right = metaid.estimate(frame, robot)
    for wrong in wrongs(names, gains):
        bad = wrong.made(frame)
        found = metaid.estimate(bad, robot, gravity=wrong.gravity)
        said = [fact.option for fact in found.facts] + [text.partition("--")[2] for text in found.verdict.reasons]
        named = any(wrong.option.removeprefix("--") in each for each in said)
        row = {"wrong": wrong.what, "named": "yes" if named else "no", "facts": f"{len(found.facts)}"}
        yield row | _beside(metaid.estimate(bad, robot, **wrong.mending(names)), right)


def _beside(found: Any, right: Any) -> dict[str, str]:
    one, other = ({each["name"]: each for each in result.summary["parameters"]} for result in (found, right))
    held = [
        name in one and abs(one[name]["value"] - each["value"]) <= 1.96 * each["sd"]
        for name, each in other.items()
        if each["sd"]
    ]
    return {"inside once mended": f"{sum(held)} of {len(held)}"}
