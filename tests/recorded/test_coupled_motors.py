"""A motor that turns with two joints, as those of wrists do: a tendon of an MJCF, which MuJoCo moves here."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest

import metaid
from metaid.plant import ArmStart, load_plant

pytestmark = pytest.mark.slow

ARM = """<mujoco><compiler angle="radian"/><option timestep="0.002"/><worldbody>
<body><joint name="shoulder" axis="0 1 0" damping="0.1"/>
<inertial mass="2" pos="0.02 0 0.2" diaginertia="0.03 0.03 0.01"/>
<body pos="0 0 0.4"><joint name="elbow" axis="0 1 0" damping="0.05"/>
<inertial mass="{mass}" pos="0.01 0 0.15" diaginertia="0.01 0.01 0.005"/>
<body pos="0 0 0.3"><joint name="wrist" axis="1 0 0" damping="0.05"/>
<inertial mass="0.5" pos="0 0.02 0.1" diaginertia="0.004 0.004 0.002"/></body></body></body></worldbody>
{tendon}</mujoco>"""
TENDON = """<tendon><fixed armature="0.2" damping="0.3"><joint joint="elbow" coef="1"/><joint joint="wrist" coef="1"/>
</fixed></tendon>"""
JOINTS = ("shoulder", "elbow", "wrist")


def log_of_motion() -> pd.DataFrame:
    """What servos read, to a tenth of a milliradian, and send."""
    model = mujoco.MjModel.from_xml_string(ARM.format(mass=1.0, tendon=TENDON))
    data, rows, random = mujoco.MjData(model), [], np.random.default_rng(0)
    for step in range(8000):
        time = step * model.opt.timestep
        wanted = np.sin([0.9 * time, 1.3 * time, 1.9 * time]) + 0.3 * np.sin([3.1 * time, 4.1 * time, 3.7 * time])
        data.qfrc_applied[:] = [200.0, 100.0, 80.0] * (wanted - data.qpos) - [12.0, 6.0, 4.0] * data.qvel
        rows.append([time, *(data.qpos + 1e-4 * random.standard_normal(3)), *data.qfrc_applied])
        mujoco.mj_step(model, data)
    return pd.DataFrame(rows, columns=["time", *(f"{kind}_{each}" for kind in ("angle", "torque") for each in JOINTS)])


def test_file_with_a_coupled_motor_is_a_nominal_robot_again(tmp_path: Path) -> None:
    """Nobody has to say once more that the motor turns with both; and what pushes cannot tell of is refused there."""
    (tmp_path / "rough.xml").write_text(ARM.format(mass=1.2, tendon=""))
    log, found = log_of_motion(), tmp_path / "found.xml"
    first = metaid.estimate(log, tmp_path / "rough.xml", coupled=[(2, 3)])
    assert first.verdict.is_found
    first.model.write(found)
    again = metaid.estimate(log, found)
    assert any("joints 'elbow' and 'wrist'" in text for text in again.nominal_repairs)
    for each in (first.estimate, again.estimate):
        assert each.model.sliding.coupled == ((1, 2),)
        assert each.values[each.model.names.index("rotor2_3")] == pytest.approx(0.2, rel=0.05)
        assert each.values[each.model.names.index("damping2_3")] == pytest.approx(0.3, rel=0.05)
    plant = load_plant(found)
    with pytest.raises(metaid.PlantError, match=r"a motor turns with joints 'elbow' and 'wrist' together \(allowed in"):
        plant.push(ArmStart(np.zeros(3), np.zeros(3)))
    study = tmp_path / "study.toml"
    study.write_text('plant = "rough.xml"\nnominal = "found.xml"\n')
    with pytest.raises(metaid.PlantError, match="a motor turns with joints"):
        metaid.load_study(study)


def test_tendon_of_other_joints_or_with_a_spring_is_refused(tmp_path: Path) -> None:
    """It is no motor that turns with the sum of two joints."""
    for change in (('joint="elbow"', 'joint="shoulder"'), ('coef="1"', 'coef="2"'), ("armature", "stiffness")):
        (tmp_path / "arm.xml").write_text(ARM.format(mass=1.0, tendon=TENDON.replace(*change, 1)))
        with pytest.raises(metaid.PlantError, match=r"has a \w+ of its own"):
            _ = load_plant(tmp_path / "arm.xml").tree
