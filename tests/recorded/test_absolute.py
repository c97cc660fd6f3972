"""Logs that measure links against the base, as films and belts do, and logs in raw units: those of a real pendulum."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pandas as pd
import pytest
from swinging import SAID

import metaid
from metaid.errors import RecordError
from metaid.files import shipped_logs
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import LinearModel, RecordedResult, absolute_of, arm_model

pytestmark = pytest.mark.slow

PARALLEL = """<mujoco><worldbody><body><inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.1"/><joint name="turn"/>
<body pos="0 0.1 0.2" euler="10 20 30"><inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.1"/>
<joint name="shoulder" axis="0 1 0"/><body pos="0 0 0.3" euler="0 40 0"><inertial pos="0 0 0.1" mass="1"
diaginertia="0.1 0.1 0.1"/><joint name="elbow" axis="0 -1 0"/><body pos="0 0 0.3"><inertial pos="0 0 0.1" mass="1"
diaginertia="0.1 0.1 0.1"/><joint name="wrist" axis="0 1 0"/></body></body></body></body></worldbody></mujoco>"""


def logs() -> list[pd.DataFrame]:
    """Three of the real double pendulum."""
    return [pd.read_csv(path) for path in shipped_logs("double-pendulum")]


def against_the_base(log: pd.DataFrame, motor: bool) -> pd.DataFrame:
    """What it is where the second angle is that of its link, and perhaps the torque that of a motor on the base."""
    torque = log["torque_1"] - (log["torque_2"] if motor else 0.0)
    return log.assign(angle_2=log["angle_1"] + log["angle_2"], torque_1=torque)


@pytest.mark.parametrize(("motor", "option"), [(False, "--absolute 2"), (True, "--absolute 2:motor")])
def test_angle_read_against_the_base_is_named_with_what_mends_it(motor: bool, option: str) -> None:
    """First of all that is named; mended, the model is that of the log as it was."""
    spoilt = [against_the_base(log, motor) for log in logs()]
    found = metaid.estimate(spoilt, "double-pendulum", **SAID)
    assert found.verdict.word == "not found"
    assert found.facts[0].option == option
    absolute, coupled = [option.removeprefix("--absolute ")], [(1, 2)] if motor else ()
    mended = metaid.estimate(spoilt, "double-pendulum", absolute=absolute, **SAID)
    plain = metaid.estimate(logs(), "double-pendulum", coupled=coupled, **SAID)
    assert mended.facts == plain.facts == ()
    moved = np.abs(mended.estimate.values - plain.estimate.values)
    assert (moved < 0.1 * plain.estimate.deviations).all()
    assert f"2 is read against the base{', and so is its torque' * motor}" in mended.records[0].repairs[-1].text


@pytest.fixture(scope="module")
def parallel(tmp_path_factory: pytest.TempPathFactory) -> tuple[mujoco.MjModel, LinearModel]:
    """An arm whose last three joints have parallel axes, the second of them turned about."""
    path = tmp_path_factory.mktemp("arms") / "parallel.xml"
    path.write_text(PARALLEL)
    arm = load_plant(path)
    assert isinstance(arm, ArmPlant)
    return mujoco.MjModel.from_xml_path(str(path)), arm_model(arm.tree)


def test_angles_of_links_are_those_that_mujoco_has(parallel: tuple[mujoco.MjModel, LinearModel]) -> None:
    """Each link turned about its joint's axis against the one that carries the first of the parallel axes."""
    model, arm = parallel
    data, joints = mujoco.MjData(model), np.array([0.3, -0.4, 0.9, 0.5])
    logged = joints.copy()
    for body, sign in ((3, -1.0), (4, 1.0)):
        turned = []
        for angles in (np.zeros(4), joints):
            data.qpos[:] = angles
            mujoco.mj_forward(model, data)
            turned.append(data.xmat[1].reshape(3, 3).T @ data.xmat[body].reshape(3, 3))
        carrier = data.xmat[1].reshape(3, 3).T @ (sign * data.xaxis[body - 1])
        between = turned[1] @ turned[0].T
        spin = np.array([between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1]])
        logged[body - 1] = np.arctan2(0.5 * sign * spin @ carrier, 0.5 * (np.trace(between) - 1.0))
    assert absolute_of(arm, ["elbow", "4"]).of_joints(logged) == pytest.approx(joints)


def test_motors_on_the_base_do_the_work_of_joints(parallel: tuple[mujoco.MjModel, LinearModel]) -> None:
    """Whatever the torques and the motion are."""
    measured, random = absolute_of(parallel[1], ["elbow:motor", "wrist:motor"]), np.random.default_rng(0)
    logged, rates = random.normal(size=(2, 5, 4))
    work = (measured.torques_of_joints(logged) * measured.of_joints(rates)).sum(axis=1)
    np.testing.assert_allclose(work, (logged * rates).sum(axis=1))
    np.testing.assert_allclose(measured.logged_torques(measured.torques_of_joints(logged)), logged)


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ("hip", "elbow, wrist, elbow:motor, wrist:motor"),
        ("shoulder", r"parallel axis \(allowed: elbow, wrist\)"),
        ("1", "joint 1"),
    ],
)
def test_joint_that_no_log_measures_so_is_refused(
    parallel: tuple[mujoco.MjModel, LinearModel], named: str, message: str
) -> None:
    """In a line that names those that one may."""
    with pytest.raises(RecordError, match=message):
        absolute_of(parallel[1], [named])


# Inertias as the defaults of a URDF are, thirty times too large.
ROUGH = {
    "links": [
        {"length": 0.3, "mass": 0.608, "com": 0.275, "inertia": 0.26},
        {"length": 0.2, "mass": 0.63, "com": 0.166, "inertia": 0.24},
    ]
}


@pytest.fixture(scope="module")
def in_newton_metres() -> RecordedResult:
    """What the logs say in their own unit, with such inertias."""
    return metaid.estimate(logs(), ROUGH, **SAID)


@pytest.mark.parametrize("unit", [400.0, 0.001])
def test_log_in_raw_units_is_identified_with_inertias_that_nobody_knows(
    in_newton_metres: RecordedResult, unit: float
) -> None:
    """As the defaults of a URDF are, thirty times too large: what the joints carry tells the unit."""
    columns = ["torque_1", "torque_2"]
    raw = [log.assign(**{column: unit * log[column] for column in columns}) for log in logs()]
    found, plain = metaid.estimate(raw, ROUGH, **SAID), in_newton_metres
    assert found.estimate.scale == pytest.approx(unit, rel=0.3)
    assert found.verdict.word == plain.verdict.word == "approximate"
    assert found.estimate.held_out.relative == pytest.approx(plain.estimate.held_out.relative, rel=0.02)


@pytest.mark.parametrize(
    ("absolute", "given", "message"),
    [
        ("2", {"law": "double-pendulum"}, "law: beside absolute"),
        ("2:motor", {"untrusted": ["2"]}, "untrusted: beside a motor that stands on the base"),
    ],
)
def test_what_is_of_joints_is_refused_beside_torques_that_are_not(
    absolute: str, given: dict[str, Any], message: str
) -> None:
    """In a line that says what is allowed."""
    with pytest.raises(RecordError, match=rf"{message} \(allowed: one of the two\)"):
        metaid.estimate("double-pendulum", "double-pendulum", absolute=[absolute], **given)


TOGETHER: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "--absolute 2 --zero all=3.1416": lambda log: log.assign(
        angle_1=log["angle_1"] + np.pi, angle_2=log["angle_1"] + log["angle_2"] + np.pi
    ),
    "--absolute 2 --scale 2=-1": lambda log: log.assign(
        angle_2=log["angle_1"] + log["angle_2"], torque_2=-log["torque_2"]
    ),
    "--scale all=-1 --zero 1=3.1416": lambda log: log.assign(
        angle_1=log["angle_1"] + np.pi, torque_1=-log["torque_1"], torque_2=-log["torque_2"]
    ),
    "--absolute 2": lambda log: log.assign(
        angle_2=log["angle_1"] + log["angle_2"], torque_1=400.0 * log["torque_1"], torque_2=400.0 * log["torque_2"]
    ),
}


@pytest.mark.parametrize("options", TOGETHER)
def test_two_things_that_are_wrong_at_once_are_named_at_once(options: str) -> None:
    """As where angles are read against the base and from hanging; beside another unit, which is found, the other."""
    found = metaid.estimate([TOGETHER[options](log) for log in logs()], "double-pendulum", **SAID)
    assert found.verdict.word == "not found"
    named = found.facts[0].option.removeprefix("--").split(" --")
    assert {*named} == {*options.removeprefix("--").split(" --")}
