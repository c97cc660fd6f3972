"""A Rokae xMate3 Pro of seven joints: 20 s at 1 kHz with sensors of the joints' torques, in three thirds.

Each third is predicted by what the other two say. Nobody has published its bodies: the nominal ones share its 22 kg
alike, in the frames of its authors.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.real.judging import Log
from benchmarks.real.lines import Line, Table
from benchmarks.real.thirds import by_thirds
from benchmarks.real.urdf import urdf_of
from metaid.models import Array

REPOSITORY = "Dynamic_Parameter_Identification_for_Rokae_xMate"  # of YanjunLIU-ac
LOGS = "filtering/data/excit/excit_{}_record.txt"
PERIOD, NJOINT = 0.001, 7  # s
ALPHA = (0.0, *(0.5 * np.pi * np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0])))
OFFSETS = (0.3415, 0.0, 0.394, 0.0, 0.366, 0.0, 0.2503)  # m
MASS, WIDE = 22.0, 0.1  # kg; m, the radius of gyration of a body


def rough() -> Array:
    """Bodies (njoint x 10) that share its mass alike, each half of the way to the next joint."""
    mass = MASS / NJOINT
    twists, offsets = np.append(ALPHA[1:], 0.0), np.append(OFFSETS[1:], 0.0)
    bodies = []
    for com in 0.5 * np.column_stack([0.0 * offsets, -np.sin(twists) * offsets, np.cos(twists) * offsets]):
        about = mass * ((WIDE**2 + com @ com) * np.eye(3) - np.outer(com, com))
        bodies.append([mass, *(mass * com), *about[np.triu_indices(3)]])
    return np.array(bodies)


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    angles, speeds, torques = (np.loadtxt(folder / LOGS.format(name)) for name in ("ang", "vel", "torque"))
    log = Log("rokae", PERIOD * np.arange(len(angles), dtype=np.float64), angles, torques, speeds)
    urdf = urdf_of("rokae", ALPHA, [0.0] * NJOINT, OFFSETS, rough(), place)
    yield from by_thirds("Rokae xMate3 Pro", log, urdf, place, "rough bodies")
