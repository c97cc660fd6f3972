"""A Rokae xMate 7 Pro: three logs of 60 s at 50 Hz with sensors of the joints' torques, in texts without names of
columns, which are read as they are. Each is predicted by what the other two say.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.real.judging import Log
from benchmarks.real.lines import Line, Table
from benchmarks.real.torques import Turn, arm_and_terms, in_turn, read_test

REPOSITORY = "xMate7p_dyn_ident"  # of NKU-ZiXuan
URDF = "data/robotparams/XM7p/urdf/XM7p.urdf"
LOGS = "data/recdata/50Hz 3周期/xMate7p_traj{}_results.csv"
RATE, NJOINT = 50.0, 7  # Hz; columns are angles, speeds, accelerations, torques


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    urdf = place / "xmate7.urdf"  # MuJoCo finds no meshes of packages
    text = (folder / URDF).read_text(encoding="utf-8")
    urdf.write_text(re.sub(r"<(visual|collision)>.*?</\1>", "", text, flags=re.DOTALL), encoding="utf-8")
    plain, classic = arm_and_terms(urdf)
    paths = [folder / LOGS.format(number) for number in (1, 2, 3)]
    logs = [_read(path) for path in paths]
    turns = []
    for left_out, log in enumerate(logs):
        others = [number for number in range(3) if number != left_out]
        test = read_test(log)
        turns.append(Turn(log.name, [str(paths[other]) for other in others], [logs[other] for other in others], test))
    own = in_turn(turns, urdf, place, ("URDF, fitted friction", plain), classic)
    yield from own.told("Rokae xMate 7 Pro", "logs held out")


def _read(path: Path) -> Log:
    cells = np.loadtxt(path, delimiter=",")
    angles, speeds, _, torques = np.split(cells[:, : 4 * NJOINT], 4, axis=1)
    return Log(path.stem, np.arange(len(cells)) / RATE, angles, torques, speeds)
