"""An arm of six joints of Shanghai Electric: from two logs of 22 s to the third, torques of the first three joints.

The logs are text of a controller, three rows of 2 ms to each reading. Its authors give a constant to the torques and
turn those of joint 3. What the drives of joints 4 to 6 log falls as they move faster, by more than friction holds:
metaid names these joints, and nothing is fitted to their torques. The nominal bodies are the authors' own, from a
drawing, in modified Denavit-Hartenberg frames.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

import metaid
from benchmarks.real.judging import Log, Missed
from benchmarks.real.lines import Line, Table
from benchmarks.real.torques import CLASSIC, Turn, arm_and_terms, in_turn, read_test
from benchmarks.real.urdf import urdf_of
from metaid.models import Array

REPOSITORY = "robot_identification"  # of Naruton94
LOGS, NJOINT, JUDGED = (1, 2, 3), 6, 3
FALLING = ("joint4", "joint5", "joint6")
PERIOD, HELD = 0.002, 3  # s between rows, of which so many are of one reading
GEAR, COUNT = 101.0, np.repeat([3.442383e-4, 1.342773e-4], 3)  # N m in a count, at the motor
SIGNS = np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
A, D = (0.0, 0.0, -0.416, -0.4208, 0.0, 0.0), (0.1181, 0.0, 0.0, 0.1301, 0.1021, 0.0568)  # m
ALPHA = (0.0, 0.5 * np.pi, 0.0, 0.0, 0.5 * np.pi, -0.5 * np.pi)
# Of each link mass in kg, first moment in kg m, and xx, xy, xz, yy, yz, zz in kg m² about the origin of its frame.
BODIES = np.array(
    [
        [2.0, -0.0165, -0.0256, -0.0456, 0.00389, 7.64e-5, 3.4e-4, 0.00333, 2.15e-4, 0.00263],
        [3.42, 0.4264, -0.0124, 0.3868, 0.0475, 3.0e-6, -0.05282, 0.13118, 0.00173, 0.08643],
        [1.26, 0.1391, 0.0, 0.0412, 0.00223, 0.0, -0.00375, 0.02647, 0.0, 0.02488],
        [0.8, 0.0, 0.0, -0.0048, 7.73e-4, 0.0, 0.0, 5.37e-4, -6.0e-6, 6.5e-4],
        [0.8, 0.0, -3.0e-4, -0.0046, 7.71e-4, 0.0, 0.0, 5.31e-4, 6.0e-6, 6.53e-4],
        [0.35, 0.0, 0.0, -0.0068, 2.61e-4, 0.0, 0.0, 2.62e-4, 0.0, 1.75e-4],
    ]
)


def read_log(folder: Path, number: int) -> tuple[pd.DataFrame, Log]:
    """A log as its user has it, with the authors' constants, and the readings of it."""

    own = folder / "matlab_identification" / "data" / f"DataOutput_Traj{number}"

    def columns_of(kind: str) -> Array:
        paths = [own / f"DataOutput_{kind}{joint}.txt" for joint in range(1, NJOINT + 1)]
        cells = [pd.read_csv(path, sep=":=|F", engine="python", header=None, usecols=[1])[1] for path in paths]
        return np.column_stack(cells).astype(np.float64)

    kinds = ("theta", "velocity", "torque")
    angles, speeds, torques = columns_of("theta"), columns_of("velocity"), GEAR * COUNT * SIGNS * columns_of("torque")
    times = PERIOD * np.arange(len(angles), dtype=np.float64)
    columns = {
        f"{kind}{joint + 1}": each[:, joint]
        for kind, each in zip(kinds, (angles, speeds, torques), strict=True)
        for joint in range(NJOINT)
    }
    fresh = np.flatnonzero(np.append(True, (np.diff(angles, axis=0) != 0.0).any(axis=1)))
    return pd.DataFrame({"time": times, **columns}), Log(f"log {number}", times[fresh], angles[fresh], torques[fresh])


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    urdf = urdf_of("shanghai", ALPHA, A, D, BODIES, place)
    plain, classic = arm_and_terms(urdf)
    logs = {f"log {number}": read_log(folder, number) for number in LOGS}
    first = metaid.estimate([frame for frame, _ in logs.values()], urdf, friction=CLASSIC)
    yield Table("Shanghai Electric, what is named first", [{"fact": fact.text} for fact in first.facts])
    named = any(fact.option == f"--untrusted {','.join(FALLING)}" for fact in first.facts)
    yield Line("Shanghai Electric: joints whose torques fall are named", float(named), 1.0, at_least=True)
    turns = []
    for name, (_, left_out) in logs.items():
        given, learned = zip(*(each for other, each in logs.items() if other != name), strict=True)
        turns.append(Turn(name, given, learned, read_test(left_out)))
    own = in_turn(
        turns, urdf, place, ("the authors' bodies as they are, fitted friction", plain), classic, untrusted=FALLING
    )
    judged = {name: Missed(each.squares[:JUDGED], each.whole[:JUDGED]) for name, each in own.found.items()}
    yield from replace(own, found=judged).told("Shanghai Electric", "from two logs to the third")
