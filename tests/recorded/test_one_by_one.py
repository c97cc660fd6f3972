"""Logs in which one joint moves after the other, as those are who measure friction: here MuJoCo moves the arm."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest

import metaid
from metaid.models import Array
from metaid.recorded import RecordedResult

ARM = """<mujoco><option timestep="0.001"/><worldbody><body><joint name="yaw" axis="0 0 1" damping="0.4"/>
<inertial mass="3" pos="0.01 0 0.1" diaginertia="0.02 0.02 0.02"/><body pos="0 0 0.2">
<joint name="lift" axis="0 1 0" damping="0.3"/><inertial mass="{mass}" pos="0.15 0.01 0" diaginertia="0.01 0.03 0.03"/>
<body pos="0.4 0 0"><joint name="bend" axis="0 1 0" damping="0.2"/>
<inertial mass="1" pos="0.1 0 0.02" diaginertia="0.003 0.006 0.006"/></body></body></body></worldbody></mujoco>"""
JOINTS = ("yaw", "lift", "bend")
POSE = np.array([0.3, -0.4, 0.7])  # rad, of joints that are held: their brakes are on
COARSE = 4e-4  # rad, the step of the encoders
SLOW = 2e-2  # rad/s, that of the speeds, which are never read as zero


def log_of(moved: int, every: int, jitter: float = 0.0, borne: float = 0.0) -> pd.DataFrame:
    """What is read of the arm every so many ms while one joint moves alone.

    Args:
        moved: the joint.
        every: from one row to the next, in ms.
        jitter: standard deviation of the stamps, in s.
        borne: which share of the torques of the others the brakes bear.
    """
    model = mujoco.MjModel.from_xml_string(ARM.format(mass=2.0))
    data, random, rows = mujoco.MjData(model), np.random.default_rng(moved), []
    times = np.arange(0.0, 24.0, 0.001 * every)
    for time in times:
        angle = 0.8 * np.sin(0.9 * time) + 0.25 * np.sin(2.3 * time)
        speed = 0.72 * np.cos(0.9 * time) + 0.575 * np.cos(2.3 * time)
        faster = -0.648 * np.sin(0.9 * time) - 1.3225 * np.sin(2.3 * time)
        data.qpos[:], data.qvel[:], data.qacc[:] = POSE, 0.0, 0.0
        data.qpos[moved], data.qvel[moved], data.qacc[moved] = POSE[moved] + angle, speed, faster
        mujoco.mj_inverse(model, data)
        angles, speeds = COARSE * np.round(data.qpos / COARSE), SLOW * (np.floor(data.qvel / SLOW) + 0.5)
        data.qfrc_inverse[np.arange(3) != moved] *= 1.0 - borne
        rows.append([time + jitter * random.normal(), *angles, *speeds, *data.qfrc_inverse])
    columns = [f"{kind}_{joint}" for kind in ("angle", "speed", "torque") for joint in JOINTS]
    return pd.DataFrame(np.array(rows), columns=["time", *columns])


def damping_of(result: RecordedResult) -> Array:
    """Of the joints (njoint), in N m s."""
    found = dict(zip(result.estimate.model.names, result.estimate.values, strict=True))
    return np.array([found[f"damping{joint}"] for joint in (1, 2, 3)])


@pytest.fixture
def nominal(tmp_path: Path) -> Path:
    """An arm whose second link is half as heavy again."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(mass=3.0))
    return path


def test_logs_of_one_joint_each_predict_what_was_left_out_of_them(nominal: Path) -> None:
    """Parts of each log are held out, for no other log tells of its joint's friction; so it is, though a host's stamps
    jitter and one log is read twelve times a second.
    """
    logs = [log_of(2, 84), log_of(1, 30, jitter=0.003), log_of(0, 20)]
    result = metaid.estimate(logs, nominal, friction=["viscous"])
    assert result.verdict.is_found
    held = result.estimate.held_out
    assert held.by == "blocks"
    assert held.relative < 0.02
    np.testing.assert_allclose(damping_of(result), [0.4, 0.3, 0.2], rtol=0.05)


def test_windows_that_are_said_are_those_of_a_log_that_is_read_often_enough(nominal: Path) -> None:
    """Whichever log is the first: those of one that is read rarely are longer."""
    result = metaid.estimate([log_of(2, 84), log_of(0, 10)], nominal, friction=["viscous"], window=0.2)
    window = result.summary["window"]
    assert (window["seconds"], window["degree"]) == (0.2, 6)


def test_what_brakes_bear_is_not_taken_for_what_links_weigh(nominal: Path) -> None:
    """A joint that is held tells little, where it moves in another log; nor is its torque judged, which is said."""
    logs = [log_of(joint, 20, borne=0.5) for joint in range(3)]
    result = metaid.estimate(logs, nominal, friction=["viscous"], validate=log_of(0, 30, borne=0.8))
    assert result.verdict.is_found
    assert result.estimate.held_out.relative < 0.04
    ((_, beside),) = result.validation
    assert beside.relative < 0.06
    np.testing.assert_array_equal(beside.of > 0.0, [True, False, False])
    np.testing.assert_allclose(damping_of(result), [0.4, 0.3, 0.2], rtol=0.1)
    assert any(
        "torques of joints that are held in a log and move in another" in each for each in result.verdict.reasons
    )


def test_joints_that_stand_still_have_no_friction_that_grows_without_bound(nominal: Path) -> None:
    """Nothing tells of it, and rounding of an angle that does not change is no motion."""
    result = metaid.estimate(log_of(1, 20), nominal, friction=["viscous"])
    damping = damping_of(result)
    assert damping[1] == pytest.approx(0.3, rel=0.05)
    assert (np.abs(damping) < 1.0).all()
