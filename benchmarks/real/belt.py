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
from benchmarks.real.judging import Log, Missed
from benchmarks.real.lines import Line, Table
from benchmarks.real.printed import printed_and_measured, printed_line
from benchmarks.real.torques import (
    CLASSIC,
    STILL,
    YARDSTICK,
    file_error,
    nominal_error,
    read_test,
    recipes,
    rivals,
    row_of,
)
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
MOST_BESIDE, LEAST_OF_MEASURED = 1.0, 0.6


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
    classic = arm_model(arm.tree, CLASSIC, coupled=((0, 1),)).with_still(np.full(2, STILL))
    printed, joints = [], [of_joints(log) for log in logs]
    for other, run in enumerate(RUNS):
        learned = [number for number in range(len(RUNS)) if number != other]
        runs, tests = [joints[number] for number in learned], [read_test(joints[other])]
        result = metaid.estimate(
            [logs[number].frame for number in learned], nominal["rough"], absolute=["joint2:motor"]
        )
        found: dict[str, Missed] = {}
        for ending in (".py", ".xml"):
            path = place / f"belt{ending}"
            result.model.write(path)
            found[f"metaid, {ending}"] = file_error(path, tests)
            printed.append({"learned without": run} | printed_and_measured(result, path, runs))
        own = [read_test(each) for each in runs]
        for name, path in nominal.items():
            bodies = mujoco.MjModel.from_xml_path(str(path))
            found[f"{name} bodies, fitted friction"] = nominal_error(bodies, own, tests)
        how, found["least squares, the best filter and weights"] = rivals({"": classic}, runs, tests)[""]
        found |= recipes(classic, runs, tests)
        best = found["least squares, the best filter and weights"].relative
        ours, said = found["metaid, .py"].relative, result.summary["held_out"]["torque"]["relative"]
        title = f"Belt, torque at {YARDSTICK} Hz of the {run} run, from the others: {result.verdict.word}, said"
        yield Table(f"{title} {said:.1%}; {how}", [row_of(name, each) for name, each in found.items()])
        yield Line(f"Belt: .py beside tuned least squares, {run} run", ours / best, MOST_BESIDE)
        yield Line(f"Belt: error that is said beside it, {run} run", said / ours, LEAST_OF_MEASURED, at_least=True)
    yield Table("Belt, errors that are printed", printed)
    yield printed_line("Belt", printed)
