"""A UR10: 27.5 s of an exciting trajectory from a ROS 2 bag, thirds held out.

Torques are the efforts of the bag: motor currents times the gains of its authors, who filtered all of it. The nominal
robot is the URDF of another repository, `figaroh-examples`, which lies beside.
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.real.judging import Log
from benchmarks.real.lines import Line, Table
from benchmarks.real.printed import printed_line
from benchmarks.real.torques import CLASSIC, STILL, YARDSTICK, Turn, in_turn, read_test, row_of
from benchmarks.real.urdf import bare_urdf
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import arm_model

REPOSITORY = "inverse-dynamics-solver"  # of unisa-acg, BSD-3; its bags of a Panda are kept for judging
BAG = "ur10_inverse_dynamics_solver/bagfiles/ur10_exciting_trajectory.db3"
URDF = "figaroh-examples/models/ur_description/urdf/ur10_robot.urdf"
NJOINT, THIRDS = 6, 3
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
    plain, arm = mujoco.MjModel.from_xml_path(str(urdf)), load_plant(urdf)
    assert isinstance(arm, ArmPlant)
    classic = arm_model(arm.tree, CLASSIC).with_still(np.full(NJOINT, STILL))
    thirds = np.array_split(np.arange(len(log.times)), THIRDS)
    turns = []
    for number, rows in enumerate(thirds, 1):
        outside = [log.rows(np.arange(rows[0])), log.rows(np.arange(rows[-1] + 1, len(log.times)))]
        learned = [run for run in outside if len(run.times)]
        turns.append(Turn(f"third {number}", [run.frame for run in learned], learned, read_test(log.rows(rows))))
    own = in_turn(turns, urdf, place, ("URDF and fitted friction", plain), classic)
    title = f"UR10, torque at {YARDSTICK} Hz, thirds held out: {', '.join(own.words)}; best {'; '.join(own.best)}"
    yield Table(title, [row_of(name, each) for name, each in own.found.items()])
    yield Table("UR10, errors that are printed", list(own.printed))
    yield printed_line("UR10", own.printed)
    yield Line("UR10: torque by the .py", own.found["metaid, .py"].relative, MOST)
    yield Line("UR10: .py beside tuned least squares", own.beside, MOST_BESIDE)
