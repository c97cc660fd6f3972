"""A UR10: 27.5 s of an exciting trajectory from a ROS 2 bag, thirds held out.

Torques are the efforts of the bag: motor currents times the gains of its authors, who filtered all of it. The nominal
robot is the URDF of another repository, `figaroh-examples`, which lies beside.
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.real.judging import Log
from benchmarks.real.lines import Line, Table
from benchmarks.real.torques import Turn, arm_and_terms, in_turn, read_test
from benchmarks.real.urdf import bare_urdf

REPOSITORY = "inverse-dynamics-solver"  # of unisa-acg, BSD-3; its bags of a Panda are kept for judging
BAG = "ur10_inverse_dynamics_solver/bagfiles/ur10_exciting_trajectory.db3"
URDF = "figaroh-examples/models/ur_description/urdf/ur10_robot.urdf"
THIRDS = 3
MOST, MOST_BESIDE = 0.08, 1.02


def read_log(path: Path) -> Log:
    """The bag's `sensor_msgs/JointState`: what follows the names are three lists of six numbers."""
    with sqlite3.connect(path) as bag:
        messages = bag.execute("SELECT timestamp, data FROM messages ORDER BY timestamp").fetchall()
    lists = struct.Struct("<" + "I4x6d" * 3)
    rows = np.array([np.delete(lists.unpack(data[-lists.size :]), [0, 7, 14]) for _, data in messages])
    times = 1e-9 * np.array([time for time, _ in messages], dtype=np.float64)
    angles, speeds, torques = np.split(rows, 3, axis=1)
    return Log("ur10", times - times[0], angles, torques, speeds)


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; CSV and model files are written to a `place`. None where the URDF is not beside."""
    described = folder.parent / URDF
    if not described.is_file():
        return
    log, urdf = read_log(folder / BAG), bare_urdf(described, place)
    plain, classic = arm_and_terms(urdf)
    thirds = np.array_split(np.arange(len(log.times)), THIRDS)
    turns = []
    for number, rows in enumerate(thirds, 1):
        outside = [log.rows(np.arange(rows[0])), log.rows(np.arange(rows[-1] + 1, len(log.times)))]
        learned = [run for run in outside if len(run.times)]
        turns.append(Turn(f"third {number}", [run.frame for run in learned], learned, read_test(log.rows(rows))))
    own = in_turn(turns, urdf, place, ("URDF and fitted friction", plain), classic)
    yield from own.told("UR10", "thirds held out", MOST_BESIDE)
    yield Line("UR10: torque by the .py", own.found["metaid, .py"].relative, MOST)
