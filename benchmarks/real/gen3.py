"""A Kinova Gen3 of seven joints: ten logs at 1 kHz, torques by the currents of its motors. The slow log of all joints
is predicted by the fast ones and those of single joints, and the two fast ones of 2 s, of one motion, by the slow ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from benchmarks.real.judging import Log
from benchmarks.real.lines import Line, Table
from benchmarks.real.torques import Turn, arm_and_terms, in_turn, read_test
from benchmarks.real.urdf import balanced_urdf

REPOSITORY = "dynamic-identification"  # of wissem01chiha, at 44f47d5
URDF = "robots/kinovaGen3.urdf"
FOLDER = "datasets/kinova"
SLOW, FAST = "RecordTrajectory_quadratic", ("RunTrajectory1", "Trajectory1")
SINGLE = tuple(f"joint_{joint}_trapez" for joint in range(1, 8))
NJOINT = 7
CURRENTS = {"TorqueCur": "torque"}


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    paths = {name: folder / FOLDER / "identification_data" / f"{name}.csv" for name in (SLOW, *FAST)}
    paths |= {name: folder / FOLDER / "jointwise_motion" / f"{name}.csv" for name in SINGLE}
    logs = {name: _read(path) for name, path in paths.items()}
    plain, classic = arm_and_terms(balanced_urdf(folder / URDF, place))
    turns = []
    for name, others in ((SLOW, FAST), *((fast, (SLOW,)) for fast in FAST)):
        learned = [*others, *SINGLE]
        turns.append(
            Turn(name, [str(paths[each]) for each in learned], [logs[each] for each in learned], read_test(logs[name]))
        )
    for part, how in ((turns[:1], "slow from the rest"), (turns[1:], "fast from the slow")):
        own = in_turn(part, folder / URDF, place, ("URDF, fitted friction", plain), classic, columns=CURRENTS)
        yield from own.told(f"Gen3, {how}", "logs held out")


def _read(path: Path) -> Log:
    cells = pd.read_csv(path)
    angles, speeds, torques = (
        cells[[f"{kind}{joint}" for joint in range(1, NJOINT + 1)]].to_numpy(float)
        for kind in ("Position", "Velocity", "TorqueCur")
    )
    return Log(path.stem, cells["Time"].to_numpy(float) / 1e3, angles, torques, speeds)
