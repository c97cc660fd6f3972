"""The left arm of a robot with two, of seven joints: three logs of 30 s at 100 Hz, each predicted by the two others.

They are lines of fifty numbers without names: degrees, turns a minute, and the currents of motors, which stand for
torques. The nominal bodies are those of its drawings, of which metaid says that they need four times the currents.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.real.judging import Log
from benchmarks.real.lines import Line, Table
from benchmarks.real.torques import Turn, arm_and_terms, in_turn, read_test
from benchmarks.real.urdf import urdf_of

REPOSITORY = "dyn_ident_dualArmV2"  # of hujinfei1994
LOGS = "code/para_est/coupled_ident/dualArmV2_data_write_excitation_{}.txt"
NUMBERS = ("13.5", "15.7", "52.2")
COLUMNS = {"column": "time,angle:deg,speed:rpm,torque,-28"}
SCALE, NJOINT = 4.0, 7  # N m for one A
TWISTS = tuple(0.5 * np.pi * np.array([-1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0]))
ALONG = (0.0, 0.0, 0.0, 0.03857, 0.0, 0.0, 0.065)  # m
OFFSETS = (0.18, 0.0, 0.27, 0.0, 0.2, 0.0, 0.0)  # m
TURNED = (0.5 * np.pi, 0.0, 0.0, 0.0, 0.0, -0.5 * np.pi, 0.0)
MASSES = (1.960, 0.419, 1.619, 1.096, 0.929, 0.857, 0.75)  # kg
COMS = (  # mm
    (0.004, 12.718, -33.668),
    (-4.550, -31.695, 4.619),
    (2.656, 1.056, -128.419),
    (-0.094, -2.353, -9.950),
    (-0.022, 0.792, -90.679),
    (7.438, 0.865, -8.053),
    (1.234, 0.003, 9.177),
)
MOMENTS = (  # kg mm², xx, xy, xz, yy, yz, zz
    (7349.372, 0.176, 0.242, 6162.807, 9.036, 2742.345),
    (1528.474, 59.489, -1.428, 1175.640, -26.682, 976.356),
    (33248.328, 63.721, -117.687, 32877.342, -8.586, 1702.698),
    (1396.650, -1.520, -3.727, 1266.299, 9.337, 793.671),
    (9416.991, -0.019, 1.237, 9231.303, -1.512, 624.886),
    (995.205, 46.484, 0.0, 1124.033, 0.108, 873.805),
    (736.697, -0.023, -2.746, 753.754, 0.124, 320.146),
)


def read_log(path: Path) -> Log:
    """A log of the repository."""
    rows = np.loadtxt(path)
    angles, turns, currents = (rows[:, 1 + NJOINT * kind :][:, :NJOINT] for kind in range(3))
    return Log(path.stem, rows[:, 0], np.deg2rad(angles), SCALE * currents, 2.0 * np.pi / 60.0 * turns)


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    masses = np.array(MASSES)[:, None]
    bodies = np.hstack([masses, 1e-3 * masses * np.array(COMS), 1e-6 * np.array(MOMENTS)])
    urdf = urdf_of("dual_arm", TWISTS, ALONG, OFFSETS, bodies, place, TURNED)
    paths = {number: folder / LOGS.format(number) for number in NUMBERS}
    logs = {number: read_log(path) for number, path in paths.items()}
    plain, classic = arm_and_terms(urdf)
    turns = []
    for number, log in logs.items():
        others = [other for other in NUMBERS if other != number]
        turns.append(
            Turn(number, [str(paths[each]) for each in others], [logs[each] for each in others], read_test(log))
        )
    scale = dict.fromkeys((f"joint{joint}" for joint in range(1, NJOINT + 1)), SCALE)
    own = in_turn(turns, urdf, place, ("URDF, fitted friction", plain), classic, columns=COLUMNS, scale=scale)
    yield from own.told("left arm of two", "each log from the two others")
