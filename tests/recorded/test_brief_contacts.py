"""A joint that meets something for a moment is named, with the time: here MuJoCo moves the arm against an end stop."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest
from conftest import Finished
from swinging import SAID

import metaid

pytestmark = pytest.mark.slow

ARM = """<mujoco><option timestep="0.002"/><worldbody><body><joint name="shoulder" axis="0 1 0" damping="0.1"/>
<inertial mass="2" pos="0.02 0 0.2" diaginertia="0.03 0.03 0.01"/><body pos="0 0 0.4">
<joint name="elbow" axis="0 1 0" damping="0.05" limited="true" range="-100 60"/>
<inertial mass="{mass}" pos="0.01 0 0.15" diaginertia="0.01 0.01 0.005"/></body></body></worldbody>
<actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator></mujoco>"""
MET = 7.5  # s
ASKED = SAID | {"friction": ["viscous"], "window": 0.1, "zeros": False}


@cache
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


def test_end_stop_that_a_joint_meets_once_is_named_with_the_option_that_leaves_it_out(tmp_path: Path) -> None:
    """And no longer once it is left out, which is said."""
    log, nominal = log_of_motion(), tmp_path / "arm.xml"
    nominal.write_text(ARM.format(mass=1.2))
    (fact,) = metaid.estimate(log, nominal, **ASKED).facts
    match = re.match(
        r"\d+% of what is left of joint elbow is about ([\d.]+) s after frame 1 begins, as of an", fact.text
    )
    assert match is not None
    assert float(match[1]) == pytest.approx(MET, abs=0.1)
    option = re.fullmatch(r"--leave-out 'frame 1=([\d.]+),([\d.]+)'", fact.option)
    assert option is not None
    stretch = float(option[1]), float(option[2])
    result = metaid.estimate(log, nominal, **ASKED, leave_out={"frame 1": [stretch]})
    assert result.verdict.is_found
    assert not result.facts
    assert result.records[0].repairs[-1].text.endswith(f"from {stretch[0]:g} to {stretch[1]:g} s left out, as asked")


def test_what_is_left_out_is_not_fitted(tmp_path: Path) -> None:
    """As if nobody knew what the torques were there."""
    log, nominal = log_of_motion(), tmp_path / "arm.xml"
    nominal.write_text(ARM.format(mass=1.2))
    other = log.copy()
    other.loc[other["time"].between(7.0, 8.0), ["torque_shoulder", "torque_elbow"]] = 50.0
    one, two = (metaid.estimate(each, nominal, **ASKED, leave_out={"frame 1": [(6.9, 8.1)]}) for each in (log, other))
    assert two.verdict.lumps["identified"].tolist() == pytest.approx(one.verdict.lumps["identified"].tolist(), rel=1e-3)


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ("arm=1,2", "leave-out: unknown log 'arm'"),
        ("log.csv=20,21", r"leave-out: log.csv has no row from 20 to 21 s \(allowed: some of 0 to 16 s\)"),
        ("log.csv=0,20", "leave-out: log.csv has all but a few rows from 0 to 20 s"),
        ("log.csv=7", r"--leave-out 'log.csv=7' \(allowed: LOG=S,S, as log.csv=10.9,11.4\)"),
    ],
)
def test_stretch_that_is_not_in_a_log_is_refused(metaid: Callable[..., Finished], option: str, said: str) -> None:
    Path("arm.xml").write_text(ARM.format(mass=1.2))
    log_of_motion().to_csv("log.csv", index=False)
    result = metaid("estimate", "log.csv", "--nominal", "arm.xml", "--leave-out", option)
    assert result.status == 2
    assert re.search(said, result.err)
