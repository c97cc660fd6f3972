"""Springs in joints, as counterbalanced arms have them, are found beside the bodies: here MuJoCo moves the arm."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest

import metaid

pytestmark = pytest.mark.slow

ARM = """<mujoco><compiler angle="radian"/><option timestep="0.002"/><worldbody><body><joint name="turret" axis="0 0 1"
damping="0.2" {turret}/><inertial mass="3" pos="0 0 0.1" diaginertia="0.02 0.02 0.02"/><body pos="0 0 0.2"><joint
name="shoulder" axis="0 1 0" damping="0.1" {spring}/><inertial mass="2" pos="0.02 0 0.2" diaginertia="0.03 0.03 0.01"/>
<body pos="0 0 0.4"><joint name="elbow" axis="0 1 0" damping="0.05"/><inertial mass="{mass}" pos="0.01 0 0.15"
diaginertia="0.01 0.01 0.005"/></body></body></body></worldbody></mujoco>"""
JOINTS = ("turret", "shoulder", "elbow")
STIFFNESS, SLACK = 12.0, 0.4  # N m/rad, rad
SPRING = f'stiffness="{STIFFNESS}" springref="{SLACK}"'


def log_of_motion(spring: str = "", turret: str = "") -> pd.DataFrame:
    """What servos read, to a tenth of a milliradian, and send, with springs in the shoulder and the turret."""
    model = mujoco.MjModel.from_xml_string(ARM.format(mass=1.0, spring=spring, turret=turret))
    data, rows, random = mujoco.MjData(model), [], np.random.default_rng(0)
    gain, damping = np.array([80.0, 200.0, 60.0]), np.array([5.0, 12.0, 3.0])
    for step in range(8000):
        time = step * model.opt.timestep
        wanted = np.sin([0.9 * time, 1.3 * time, 1.9 * time]) + 0.3 * np.sin([3.1 * time, 4.1 * time, 3.7 * time])
        data.qfrc_applied[:] = gain * (wanted - data.qpos) - damping * data.qvel
        rows.append([time, *(data.qpos + 1e-4 * random.standard_normal(3)), *data.qfrc_applied])
        mujoco.mj_step(model, data)
    return pd.DataFrame(rows, columns=["time", *(f"{kind}_{each}" for kind in ("angle", "torque") for each in JOINTS)])


@pytest.fixture
def nominal(tmp_path: Path) -> Path:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(mass=1.2, spring="", turret=""))
    return path


def test_spring_that_nobody_said_is_found_and_is_in_the_files(nominal: Path, tmp_path: Path) -> None:
    """Where it is, how stiff, and where it is slack; MJCF and Python have it, a URDF says that it has not."""
    result = metaid.estimate(log_of_motion(SPRING), nominal)
    assert result.verdict.is_found
    assert not result.facts
    found = result.estimate
    assert found.model.having("spring") == [1]
    stiffness, offset = (found.values[found.model.names.index(name)] for name in ("spring2", "offset2"))
    assert stiffness == pytest.approx(STIFFNESS, rel=0.02)
    assert -offset / stiffness == pytest.approx(SLACK, abs=0.02)
    for suffix in (".py", ".xml", ".urdf"):
        result.model.write(tmp_path / f"found{suffix}")
    for suffix in (".py", ".xml"):
        error = result.error_of(tmp_path / f"found{suffix}").relative
        assert error is not None
        assert error < 0.005
    loaded = mujoco.MjModel.from_xml_path(str(tmp_path / "found.xml"))
    assert loaded.jnt_stiffness[[0, 2]].tolist() == [0.0, 0.0]
    assert loaded.jnt_stiffness[1] == pytest.approx(STIFFNESS, rel=0.02)
    assert loaded.qpos_spring[1] == pytest.approx(SLACK, abs=0.02)
    again = metaid.estimate(log_of_motion(SPRING), tmp_path / "found.xml").estimate
    assert again.model.having("spring") == [1]
    assert "this file has no springs; joint shoulder has one of 1" in (tmp_path / "found.urdf").read_text()


def test_arm_without_a_spring_is_given_none(nominal: Path) -> None:
    """Though it was tried."""
    found = metaid.estimate(log_of_motion(), nominal).estimate
    assert "spring" in [what for what, _ in found.chosen.tried]
    assert "spring" not in found.model.terms


def test_spring_that_is_asked_for_is_in_every_joint(nominal: Path) -> None:
    """Where it is none it is nothing."""
    found = metaid.estimate(log_of_motion(SPRING), nominal, friction=("viscous", "offset", "spring")).estimate
    stiffness = [found.values[found.model.names.index(f"spring{joint}")] for joint in (1, 2, 3)]
    np.testing.assert_allclose(stiffness, [0.0, STIFFNESS, 0.0], atol=0.25)


def test_spring_of_a_turret_whose_zero_nothing_else_tells_is_named_alone(nominal: Path) -> None:
    """Its encoder may begin at 0 wherever it is: where the spring is slack in this log holds of no other. Who knows
    better asks for it.
    """
    log = log_of_motion(turret='stiffness="2"')
    result = metaid.estimate(log, nominal)
    assert "spring" not in result.estimate.model.terms
    assert any("a spring of joint turret" in reason for reason in result.verdict.reasons)
    asked = metaid.estimate(log, nominal, friction=("viscous", "spring")).estimate
    assert asked.values[asked.model.names.index("spring1")] == pytest.approx(2.0, rel=0.02)
