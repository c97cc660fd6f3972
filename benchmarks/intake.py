"""Logs as people have them: every defect that intake knows, at three sizes, in one clean log.

    python -m benchmarks.intake [--only jitter wild] [--json]

The log is of a simulated arm of three joints that swings for 20 s at 500 Hz, with 0.1 mrad of noise and encoder steps,
1 mrad/s of noise of the speeds, and 0.5 % of the torques. Each row of the table says of three sizes what was repaired
of the largest, or why it was refused, and how far the torque of the bodies is off along the clean motion. `WRONG` marks
a log that is taken though fewer than nine of ten parameters of the clean log have a value within both 95 % intervals,
or the torque is off by twice that of the clean log and by 1 % more. Angles from hanging are those of the shipped logs
of a real double pendulum, one to three of them. `--json` has each size by itself, and how many parameters agree.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from itertools import groupby

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from benchmarks.common import table
from metaid.errors import MetaidError
from metaid.files import shipped_logs
from metaid.models import Array
from metaid.models.tree import joint_torque
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import RecordedResult, estimate

PLANT = "spatial-three-link"
RATE, SECONDS = 500.0, 20.0
DAMPING, DRY = np.array([0.5, 0.2, 0.1]), np.array([0.3, 0.2, 0.1])
HANGING, PENDULUM = "angles from hanging", "double-pendulum"
AGREE, WORSE, MORE = 0.9, 2.0, 0.01
TERMS = ("viscous", "coulomb")


@dataclass(frozen=True)
class Row:
    """One defect at one size."""

    defect: str
    size: str
    said: str
    verdict: str
    agree: str = "–"
    error: str = "–"
    wrong: str = ""


@dataclass(frozen=True)
class Motion:
    """The clean log, and the states and torques of the bodies that it was made of (nrow x njoint each)."""

    log: pd.DataFrame
    angles: Array
    speeds: Array
    accelerations: Array
    torques: Array

    @property
    def joints(self) -> list[int]:
        return [1 + joint for joint in range(self.angles.shape[1])]


def motion() -> Motion:
    """The clean log."""
    plant = load_plant(PLANT)
    assert isinstance(plant, ArmPlant)
    tree = plant.tree.with_parameters(plant.tree.parameters * np.array([1.0] * 11 + [0.0, 0.0]))
    random = np.random.default_rng(0)
    times = np.arange(round(SECONDS * RATE)) / RATE
    pulse, phase = random.uniform(1.0, 6.0, (3, tree.njoint)), random.uniform(0.0, 2.0 * np.pi, (3, tree.njoint))
    size = random.uniform(0.2, 0.5, (3, tree.njoint))
    angle = times[:, None, None] * pulse + phase
    swing = [(size * np.sin(angle)).sum(axis=1), (size * pulse * np.cos(angle)).sum(axis=1)]
    swing.append(-(size * pulse**2 * np.sin(angle)).sum(axis=1))
    begun = np.minimum(times, 1.0)[:, None]  # from rest, within a second
    grows = [begun**3 * (10.0 - 15.0 * begun + 6.0 * begun**2), 30.0 * begun**2 * (1.0 - begun) ** 2]
    grows.append(60.0 * begun * (1.0 - begun) * (1.0 - 2.0 * begun))
    angles = grows[0] * swing[0]
    speeds = grows[1] * swing[0] + grows[0] * swing[1]
    accelerations = grows[2] * swing[0] + 2.0 * grows[1] * swing[1] + grows[0] * swing[2]
    torques = joint_torque(tree, angles, speeds, accelerations)
    sent = torques + DAMPING * speeds + DRY * np.tanh(speeds / 0.01)
    noise = random.standard_normal((3, *angles.shape))
    columns = {"time": times}
    for joint in range(tree.njoint):
        name = joint + 1
        columns[f"angle_{name}"] = np.round(angles[:, joint] + 1e-4 * noise[0, :, joint], 4)
        columns[f"speed_{name}"] = speeds[:, joint] + 1e-3 * noise[1, :, joint]
        columns[f"torque_{name}"] = sent[:, joint] * (1.0 + 5e-3 * noise[2, :, joint])
    return Motion(pd.DataFrame(columns), angles, speeds, accelerations, torques)


def _some(log: pd.DataFrame, share: float) -> NDArray[np.bool_]:
    """Rows (nrow) that are a share of the log, never the first."""
    chosen = np.random.default_rng(1).random(len(log)) < share
    chosen[:3] = False
    return np.asarray(chosen, dtype=np.bool_)


def _holes(log: pd.DataFrame, share: float) -> pd.DataFrame:
    return log.assign(angle_2=log["angle_2"].where(~_some(log, share)))


def _twice(log: pd.DataFrame, share: float) -> pd.DataFrame:
    """Readings that are written again instead of the next ones, under new stamps."""
    rows = np.arange(len(log))
    stale = _some(log, share)
    rows[stale] -= 1
    return log.iloc[rows].reset_index(drop=True).assign(time=log["time"])


def _doubled(log: pd.DataFrame, share: float) -> pd.DataFrame:
    rows = np.sort(np.concatenate([np.arange(len(log)), np.flatnonzero(_some(log, share))]))
    return log.iloc[rows].reset_index(drop=True)


def _shuffled(log: pd.DataFrame, share: float) -> pd.DataFrame:
    """Rows that come a few rows too late."""
    late = np.arange(len(log)) + 5.5 * _some(log, share)
    return log.iloc[np.argsort(late)].reset_index(drop=True)


def _lost(log: pd.DataFrame, share: float) -> pd.DataFrame:
    return log[~_some(log, share)].reset_index(drop=True)


def _jitter(log: pd.DataFrame, periods: float) -> pd.DataFrame:
    """Stamps of a host that is late, by half a normal distribution of so many periods."""
    late = periods / RATE * np.abs(np.random.default_rng(2).standard_normal(len(log)))
    return log.assign(time=np.maximum.accumulate(log["time"] + late))


def _wild(column: str) -> Callable[[pd.DataFrame, float], pd.DataFrame]:
    def change(log: pd.DataFrame, size: float) -> pd.DataFrame:
        return log.assign(**{column: log[column] + size * _some(log, 1.0 / 2000.0)})

    return change


def _gap(log: pd.DataFrame, seconds: float) -> pd.DataFrame:
    return log.assign(time=log["time"] + seconds * (log["time"] > 9.0))


def _rest(log: pd.DataFrame, seconds: float) -> pd.DataFrame:
    """Rest before the motion, whose torques dry friction hides, and whose readings are noise and steps of encoders."""
    random, count = np.random.default_rng(3), round(seconds * RATE)
    still = pd.DataFrame({"time": np.arange(count) / RATE - seconds})
    for column in log.columns[1:]:
        first = float(log[column].iloc[0])
        read = np.full(count, 0.0 if column.startswith("speed") else first)
        if column.startswith("angle"):
            read = np.round(read + 1e-4 * random.standard_normal(count), 4)
        elif column.startswith("speed"):
            read = 1e-3 * random.standard_normal(count)
        else:
            read = 0.95 * read
        still[column] = read
    return pd.concat([still, log], ignore_index=True)


def _wrapped(log: pd.DataFrame, share: float) -> pd.DataFrame:
    """An encoder that says −π to π, mounted so that the joint turns over its end."""
    angle = log["angle_1"] + np.pi - share
    turned = (angle + np.pi) % (2.0 * np.pi) - np.pi
    return log.assign(angle_1=turned)


def _without_speeds(log: pd.DataFrame) -> pd.DataFrame:
    return log[[column for column in log.columns if not column.startswith("speed")]]


Change = Callable[[pd.DataFrame, float], pd.DataFrame]
DEFECTS: dict[str, tuple[Change, dict[str, float]]] = {
    "unit of times": (
        lambda log, size: log.assign(time=np.round(log["time"] * size) + 1.7e9 * size),
        {"ms": 1e3, "µs": 1e6, "ns": 1e9},
    ),
    "cells without a number": (_holes, {"0.1 %": 0.001, "1 %": 0.01, "10 %": 0.1}),
    "stale rows under new stamps": (_twice, {"0.1 %": 0.001, "1 %": 0.01, "10 %": 0.1}),
    "rows that are there twice": (_doubled, {"0.1 %": 0.001, "1 %": 0.01, "10 %": 0.1}),
    "rows in disorder": (_shuffled, {"0.1 %": 0.001, "1 %": 0.01, "10 %": 0.1}),
    "lost packets": (_lost, {"1 %": 0.01, "5 %": 0.05, "20 %": 0.2}),
    "jitter of stamps": (_jitter, {"0.1 periods": 0.1, "0.4 periods": 0.4, "1.2 periods": 1.2}),
    "the same, no speeds": (
        lambda log, size: _without_speeds(_jitter(log, size)),
        {"0.1 periods": 0.1, "0.4 periods": 0.4, "1.2 periods": 1.2},
    ),
    "the same, 5 % lost": (
        lambda log, size: _lost(_jitter(log, size), 0.05),
        {"0.1 periods": 0.1, "0.4 periods": 0.4, "1.2 periods": 1.2},
    ),
    "wild angle": (_wild("angle_2"), {"0.03 rad": 0.03, "1 rad": 1.0, "1000 rad": 1000.0}),
    "wild torque": (_wild("torque_1"), {"10 N m": 10.0, "1e3 N m": 1e3, "1e30 N m": 1e30}),
    "gap": (_gap, {"0.2 s": 0.2, "60 s": 60.0, "a year": 3.2e7}),
    "rest of noise and rounding": (_rest, {"5 s": 5.0, "20 s": 20.0, "60 s": 60.0}),
    "angle cut at a full turn": (_wrapped, {"0.5 rad": 0.5, "0.1 rad": 0.1, "0 rad": 0.0}),
    "angles in degrees": (
        lambda log, size: log.assign(**{f"angle_{joint}": log[f"angle_{joint}"] * size for joint in (1, 2, 3)}),
        {"°": 180.0 / np.pi, "gon": 200.0 / np.pi, "turns": 0.5 / np.pi},
    ),
}


def _read(log: pd.DataFrame, zero: float = 0.0) -> RecordedResult:
    return estimate(log, PLANT, friction=TERMS, zero={"1": zero} if zero else None)


def _error(result: RecordedResult, clean: Motion) -> float:
    """How far the torque of the bodies is off along the clean motion, as a share of it."""
    model = result.estimate.model
    columns = model.bodies(clean.angles, clean.speeds, clean.accelerations)
    said = columns @ result.estimate.values[: model.nbody]
    return float(np.linalg.norm(said - clean.torques) / np.linalg.norm(clean.torques))


def rows(only: list[str]) -> Iterator[Row]:
    """The table, row by row."""
    clean = motion()
    usual = _read(clean.log)
    error = _error(usual, clean)
    yield Row("none", "–", "nothing", usual.verdict.word, error=f"{error:.2%}")
    for defect, (change, sizes) in DEFECTS.items():
        if only and not any(word in defect for word in only):
            continue
        for name, size in sizes.items():
            spoiled = change(clean.log, size)
            try:
                found = _read(spoiled, -(np.pi - size) if change is _wrapped else 0.0)
            except MetaidError as problem:
                yield Row(defect, name, str(problem).partition(": ")[2], "refused")
                continue
            yield _row(defect, name, found, usual, _error(found, clean), error)
    if not only or any(word in HANGING for word in only):
        yield from _hanging()


def _hanging() -> Iterator[Row]:
    """The shipped logs of a real pendulum, with angles that are 0 where it hangs."""
    logs = [pd.read_csv(path) for path in shipped_logs(PENDULUM)]
    for number in range(1, len(logs) + 1):
        turned = [log.assign(angle_1=log["angle_1"] - np.pi) for log in logs[:number]]
        found = estimate(turned, PENDULUM)
        yield Row(HANGING, f"{number} logs", "; ".join(found.verdict.reasons[:1]), found.verdict.word)


def _row(defect: str, size: str, found: RecordedResult, usual: RecordedResult, off: float, error: float) -> Row:
    ours, theirs = (result.verdict.lumps.set_index("name") for result in (found, usual))
    together = 1.96 * np.hypot(ours["sd"], theirs["sd"]) + 1e-12
    agree = float((np.abs(ours["identified"] - theirs["identified"]) <= together).mean())
    is_wrong = agree < AGREE or off > max(WORSE * error, error + MORE)
    repairs = [f"{repair.kind} {repair.count:,}" for record in found.records for repair in record.repairs]
    verdict = found.verdict.word
    silently = is_wrong and verdict != "not found"
    said = "; ".join(dict.fromkeys(repairs)) or "nothing"
    return Row(defect, size, said, verdict, f"{agree:.0%}", f"{off:.2%}", "WRONG" if silently else "")


def by_defect(found: list[Row]) -> Iterator[dict[str, str]]:
    """A line for each defect, which says of the largest size what was repaired or refused."""
    for _, same in groupby(found, lambda row: row.defect):
        sizes = list(same)
        yield {
            "defect": sizes[0].defect,
            "sizes": ", ".join(row.size for row in sizes),
            "repaired or refused": sizes[-1].said,
            "verdict": ", ".join(dict.fromkeys(row.verdict for row in sizes)),
            "torque off by": ", ".join(dict.fromkeys(row.error for row in sizes)) + "".join(row.wrong for row in sizes),
        }


def main() -> None:
    """The table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.intake")
    parser.add_argument("--only", nargs="*", default=[], help="words in the names of defects")
    parser.add_argument("--json", action="store_true", help="as JSON")
    arguments = parser.parse_args()
    found = list(rows(arguments.only))
    print(json.dumps([asdict(row) for row in found], indent=2) if arguments.json else table(list(by_defect(found))))


if __name__ == "__main__":
    main()
