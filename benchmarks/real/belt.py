"""Two links in a vertical plane, both motors on the base and one of them behind a belt: three runs of 60 s.

So the second angle and torque are those of the second link against the base, and torques are in thousandths of a
motor's rated current. metaid is told both, as it advises where it is not. The nominal model has the lengths, masses and
centres of mass that the laboratory writes down beside its logs, and 1 kg m² of each link, as its model file has. The
logs are in the history of the repository: `git checkout b30002b`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

import metaid
from benchmarks.real.judging import Log
from benchmarks.real.lines import Line, Table
from benchmarks.real.printed import printed_line
from benchmarks.real.torques import CLASSIC, STILL, compared
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import arm_model

REPOSITORY = "mujoco-sysid"  # of lvjonok
LOGS = "data/trajectories/two_link/two_link_observer_05_{}.csv"
RUNS = ("fast", "norm", "slow")
UNIT = 1.0 / 400.0  # N m of a unit of current, as the laboratory says
BELIEVED = """<mujoco><worldbody><body pos="0 0 1"><inertial pos="0.144 0 0" mass="0.91" diaginertia="{0} {0} {0}"/>
<joint name="joint1" axis="0 -1 0"/><body pos="0.327 0 0"><inertial pos="0.1 0 0" mass="0.19"
diaginertia="{1} {1} {1}"/><joint name="joint2" axis="0 -1 0"/></body></body></worldbody></mujoco>"""
ROUGH, WRITTEN = (1.0, 1.0), (0.012, 0.0009)  # kg m²


def read_log(path: Path) -> Log:
    """As it is, but for its unit."""
    times, angle, speed, other, other_speed, torque, other_torque = np.loadtxt(path).T
    angles, speeds = np.stack([angle, other], axis=1), np.stack([speed, other_speed], axis=1)
    return Log(path.stem, times - times[0], angles, UNIT * np.stack([torque, other_torque], axis=1), speeds)


def of_joints(log: Log) -> Log:
    """What its joints have of a log: the second angle is between the links, and both motors hold the first."""
    between = np.array([[1.0, -1.0], [0.0, 1.0]])
    assert log.speeds is not None
    return replace(
        log, angles=log.angles @ between, speeds=log.speeds @ between, torques=log.torques @ [[1, 0], [1, 1]]
    )


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    paths = [folder / LOGS.format(run) for run in RUNS]
    if not all(path.exists() for path in paths):
        return
    nominal = {}
    for name, inertias in (("rough", ROUGH), ("written", WRITTEN)):
        nominal[name] = place / f"{name}.xml"
        nominal[name].write_text(BELIEVED.format(*inertias), encoding="utf-8")
    logs, arm = [read_log(path) for path in paths], load_plant(nominal["rough"])
    assert isinstance(arm, ArmPlant)
    classic = arm_model(arm.tree).with_friction(CLASSIC).with_coupled(((0, 1),)).with_still(np.full(2, STILL))
    bodies = {f"{name} bodies": mujoco.MjModel.from_xml_path(str(path)) for name, path in nominal.items()}
    printed, joints = [], [of_joints(log) for log in logs]
    for other, run in enumerate(RUNS):
        learned = [number for number in range(len(RUNS)) if number != other]
        frames = [logs[number].frame for number in learned]
        result = metaid.estimate(frames, nominal["rough"], absolute=["joint2:motor"])
        seen = [joints[number] for number in learned], [joints[other]]
        for each in compared("Belt", f"of the {run} run", result, place, bodies, classic, seen):
            if isinstance(each, dict):
                printed.append(each)
            else:
                yield each
    yield Table("Belt, errors that are printed", printed)
    yield printed_line("Belt", printed)
