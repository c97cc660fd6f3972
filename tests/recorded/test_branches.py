"""A log of one arm of a robot that has two, on a lift and with a head: here MuJoCo moves the whole robot."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest
from swinging import SAID

import metaid
from metaid.errors import PlantError, RecordError

SIDE = """<body pos="0 {y} 0"><joint name="{side}_shoulder" axis="0 1 0" damping="0.1"/>
<inertial mass="2" pos="0.02 0 -0.2" diaginertia="0.03 0.03 0.01"/><body pos="0 0 -0.4">
<joint name="{side}_elbow" axis="0 1 0" damping="0.05"/>
<inertial mass="{mass}" pos="0.01 0 -0.15" diaginertia="0.01 0.01 0.005"/></body></body>"""
ROBOT = """<mujoco><option timestep="0.002"/><worldbody><body><joint name="lift" type="slide" axis="0 0 1"/>
<inertial mass="20" pos="0 0 0" diaginertia="1 1 1"/><body><joint name="head" axis="0 0 1" damping="1"/>
<inertial mass="1" pos="0 0 0.3" diaginertia="0.01 0.01 0.01"/></body>{left}{right}</body></worldbody></mujoco>"""
JOINTS = ("lift", "head", "left_shoulder", "left_elbow", "right_shoulder", "right_elbow")
STIFF = np.array([1e4, 50.0, 200.0, 60.0, 200.0, 60.0])  # N m/rad, of the servos, and N/m of the lift's


def robot(mass: float) -> str:
    return ROBOT.format(
        left=SIDE.format(side="left", y=0.3, mass=mass), right=SIDE.format(side="right", y=-0.3, mass=mass)
    )


def log_of_motion(*sides: str) -> pd.DataFrame:
    """What all servos read and send while the head turns and the arms on these sides swing."""
    model = mujoco.MjModel.from_xml_string(robot(1.0))
    data, rows = mujoco.MjData(model), []
    for step in range(8000):
        time = step * model.opt.timestep
        swings = np.array([np.sin(1.3 * time) + 0.4 * np.sin(4.1 * time), 0.7 * np.sin(1.9 * time)])
        arms = [swings if side in sides else np.zeros(2) for side in ("left", "right")]
        wanted = np.concatenate([[0.2, 0.5 * np.sin(time)], *arms])
        data.qfrc_applied[:] = STIFF * (wanted - data.qpos) - 0.06 * STIFF * data.qvel
        rows.append([time, *data.qpos, *data.qfrc_applied])
        mujoco.mj_step(model, data)
    columns = ["time", *(f"{kind}_{joint}" for kind in ("angle", "torque") for joint in JOINTS)]
    return pd.DataFrame(rows[1000:], columns=columns)  # once the lift is where it stays


def test_arm_that_moves_is_found_by_the_names_of_columns(tmp_path: Path) -> None:
    """Without the lift, which stands still below it, and without the head, which moves on a branch of its own."""
    nominal = tmp_path / "robot.xml"
    nominal.write_text(robot(1.2))
    result = metaid.estimate(log_of_motion("right"), nominal, **SAID)
    assert result.verdict.is_found
    assert result.estimate.model.joints == ("right_shoulder", "right_elbow")
    assert result.nominal_repairs == (
        "joints that logs name move, the others are held: right_shoulder, right_elbow "
        "(--joints A,B of those that move)",
    )


@pytest.mark.parametrize("renamed", [False, True])
def test_who_moves_is_asked_where_two_arms_do_or_no_column_names_one(tmp_path: Path, renamed: bool) -> None:
    """No joint is held that nobody spoke of."""
    nominal, log = tmp_path / "robot.xml", log_of_motion("left", "right")
    nominal.write_text(robot(1.2))
    if renamed:
        log = log.rename(
            columns={f"{kind}_{joint}": f"{kind}_{i}" for kind in ("angle", "torque") for i, joint in enumerate(JOINTS)}
        )
    with pytest.raises(PlantError, match="on different branches"):
        metaid.estimate(log, nominal)


def test_column_that_lacks_is_named_with_the_joints_that_are_there(tmp_path: Path) -> None:
    """As of a gripper at the end of a robot, which a log has not."""
    nominal = tmp_path / "robot.xml"
    nominal.write_text(
        ROBOT.format(left=SIDE.format(side="left", y=0, mass=1), right="").replace(
            '<joint name="head" axis="0 0 1" damping="1"/>', ""
        )
    )
    log = log_of_motion("left")[["time", "angle_lift", "angle_left_shoulder", "torque_lift", "torque_left_shoulder"]]
    with pytest.raises(RecordError, match=r"or --joints lift,left_shoulder\)"):
        metaid.estimate(log, nominal)
