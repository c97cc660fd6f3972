"""A joint that meets something for a moment is named, with the time: here MuJoCo moves the arm against an end stop."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest

import metaid

pytestmark = pytest.mark.slow

ARM = """<mujoco><option timestep="0.002"/><worldbody><body><joint name="shoulder" axis="0 1 0" damping="0.1"/>
<inertial mass="2" pos="0.02 0 0.2" diaginertia="0.03 0.03 0.01"/><body pos="0 0 0.4">
<joint name="elbow" axis="0 1 0" damping="0.05" limited="true" range="-100 60"/>
<inertial mass="{mass}" pos="0.01 0 0.15" diaginertia="0.01 0.01 0.005"/></body></body></worldbody>
<actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator></mujoco>"""
MET = 7.5  # s


def log_of_motion() -> pd.DataFrame:
    """What a servo reads and sends along a motion that leaves for a moment what the stop allows, 60°."""
    model = mujoco.MjModel.from_xml_string(ARM.format(mass=1.0))
    data, rows = mujoco.MjData(model), []
    for step in range(8000):
        time = step * model.opt.timestep
        moment = np.exp(-(((time - MET) / 0.1) ** 2))
        wanted = np.array([np.sin(1.3 * time) + 0.4 * np.sin(4.1 * time), 0.7 * np.sin(1.9 * time) + moment])
        data.ctrl[:] = [200.0, 60.0] * (wanted - data.qpos) - [12.0, 3.0] * data.qvel
        rows.append([time, *data.qpos, *data.ctrl])
        mujoco.mj_step(model, data)
    columns = ["time", *(f"{kind}_{joint}" for kind in ("angle", "torque") for joint in ("shoulder", "elbow"))]
    return pd.DataFrame(rows, columns=columns)


def test_end_stop_that_a_joint_meets_once_is_named_with_its_time(tmp_path: Path) -> None:
    """And no longer once these rows are left out."""
    log, nominal = log_of_motion(), tmp_path / "arm.xml"
    nominal.write_text(ARM.format(mass=1.2))
    reasons = metaid.estimate(log, nominal, friction=["viscous"]).verdict.reasons
    (said,) = [each for each in reasons if "an end stop, a blow or a contact" in each]
    match = re.search(r"% of what is left of joint elbow is about ([\d.]+) s after frame 1 begins: ", said)
    assert match is not None
    assert float(match[1]) == pytest.approx(MET, abs=0.1)
    without = log[(log["time"] - MET).abs() > 0.4]
    verdict = metaid.estimate(without, nominal, friction=["viscous"]).verdict
    assert verdict.is_found
    assert not any("an end stop" in each for each in verdict.reasons)
