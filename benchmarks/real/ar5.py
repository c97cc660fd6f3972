"""A Rokae AR5 of seven joints that is mounted on its side: 60 s at 50 Hz, torques by sensors of its joints, in thirds.

Its URDF has gravity along the axis of the first joint. In its log that is along x of the base, which metaid says where
it is not told (`--gravity 9.81,0,0`).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

import metaid
from benchmarks.real.judging import Log
from benchmarks.real.lines import Line, Table
from benchmarks.real.thirds import by_thirds
from benchmarks.real.urdf import bare_urdf

REPOSITORY = "Dynamics_identification_Frank"  # of FrankJIE09
LOG = "src/config/dynamics_identification_data_real.csv"
URDF = "urdf/AR5-5_07R-W4C4A2.urdf"
NJOINT = 7
DOWN = (9.81, 0.0, 0.0)  # m/s²


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    read = pd.read_csv(folder / LOG)
    angles, speeds, torques = (
        read[[f"{kind}{joint}" for joint in range(NJOINT)]].to_numpy(float) for kind in ("q", "dq", "tau")
    )
    log = Log("ar5", read["time"].to_numpy(float), angles, torques, speeds)
    urdf = bare_urdf(folder / URDF, place)
    named = [fact.option for fact in metaid.estimate(log.frame, urdf).facts]
    right = "--gravity " + ",".join(f"{each:g}" for each in DOWN)
    yield from by_thirds("AR5", log, urdf, place, "URDF", DOWN)
    yield Line("AR5: facts that are named beside where gravity points", len(set(named) ^ {right}), 0)
