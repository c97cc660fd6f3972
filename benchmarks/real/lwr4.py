"""A KUKA LWR4+: two runs of one motion of 25 s and one of another, with sensors of the joints' torques.

The URDF has an `<origin>` twice, so MuJoCo alone refuses it. Where the logs are not there, but what Git LFS has in
their places, nothing is measured.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

import metaid
from benchmarks.real.judging import Log
from benchmarks.real.lines import Line, Table
from benchmarks.real.printed import printed_line
from benchmarks.real.torques import CLASSIC, STILL, compared
from benchmarks.real.urdf import bare_urdf
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import arm_model

REPOSITORY = "FloBaRoID"  # of kjyv, LGPL-3
URDF, LOGS = "model/kuka_lwr4.urdf", "data/KUKA/HW/measurements_{}.npz"
NJOINT, LEAST = 7, 10_000  # bytes of a log


def read_log(path: Path) -> Log:
    """Angles, speeds and torques, and when they were read by the clock of a computer."""
    kept = np.load(path)
    times = kept["times"] - kept["times"][0]
    return Log(path.stem, times, kept["positions"], kept["torques"], kept["velocities"])


def once(urdf: Path) -> mujoco.MjModel:
    """A URDF without an origin that stands a second time in a joint."""
    tree = ElementTree.parse(urdf)
    for joint in tree.iter("joint"):
        for origin in joint.findall("origin")[1:]:
            joint.remove(origin)
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(tree.getroot(), encoding="unicode"))


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    paths = [folder / LOGS.format(number) for number in (1, 2, 3)]
    if min(path.stat().st_size for path in paths) < LEAST:
        return
    logs, plain, arm = (
        [read_log(path) for path in paths],
        once(bare_urdf(folder / URDF, place)),
        load_plant(folder / URDF),
    )
    assert isinstance(arm, ArmPlant)
    classic = arm_model(arm.tree).with_friction(CLASSIC).with_still(np.full(NJOINT, STILL))
    printed = []
    for learned, others in (([0, 1], [2]), ([2], [0, 1])):
        runs, tests = ([logs[number] for number in each] for each in (learned, others))
        result = metaid.estimate([run.frame for run in runs], folder / URDF)
        names = [" and ".join(str(number + 1) for number in each) for each in (learned, others)]
        run, bodies = f"from log {names[0]} to {names[1]}", {"URDF": plain}
        for each in compared("LWR4+", run, result, place, bodies, classic, (runs, tests)):
            if isinstance(each, dict):
                printed.append(each)
            else:
                yield each
    yield Table("LWR4+, errors that are printed", printed)
    yield printed_line("LWR4+", printed)
