"""A joint that meets something for moments is named, with the times: MuJoCo moves robots against a stop and a hand."""

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


PENDULUM = """<mujoco><option timestep="0.002"/><worldbody><body><joint name="swing" axis="0 1 0" damping="0.1"/>
<inertial mass="{mass}" pos="0 0 -0.4" diaginertia="0.01 0.01 0.01"/></body></worldbody>
<actuator><motor joint="swing"/></actuator></mujoco>"""
PUSHED = 3.0, 8.5, 15.0  # s


def log_of_hand(pushes: bool = True, torque: float = 1.0) -> pd.DataFrame:
    """What a pendulum reads that a motor swings with torques of one size, and a hand pushes for 0.3 s thrice."""
    model = mujoco.MjModel.from_xml_string(PENDULUM.format(mass=0.6))
    data, rows = mujoco.MjData(model), []
    for step in range(10000):
        time = step * model.opt.timestep
        data.ctrl[:] = torque * (np.tanh(20.0 * np.sin(3.7 * time)) if pushes else 1.0)
        hand = [3.0 * np.exp(-(((time - at) / 0.15) ** 2)) * (-1.0) ** i for i, at in enumerate(PUSHED)]
        data.qfrc_applied[:] = sum(hand)
        rows.append([time, *data.qpos, *data.ctrl])
        mujoco.mj_step(model, data)
    return pd.DataFrame(rows, columns=["time", "angle_1", "torque_1"])


def test_pushes_of_a_hand_are_named_where_nothing_is_found_with_them_and_all_without(tmp_path: Path) -> None:
    """All at once, though the fit that they spoil predicts nothing."""
    log, nominal = log_of_hand(), tmp_path / "pendulum.xml"
    nominal.write_text(PENDULUM.format(mass=0.7))
    result = metaid.estimate(log, nominal)
    assert not result.verdict.is_found
    (fact,) = result.facts
    assert "of what is left of joint swing is within 3 moments, as of a hand" in fact.text
    stretches = [(float(one), float(two)) for one, two in re.findall(r"'frame 1=([\d.]+),([\d.]+)'", fact.option)]
    assert [begin < at < end for at, (begin, end) in zip(PUSHED, stretches, strict=True)] == [True] * 3
    mended = metaid.estimate(log, nominal, leave_out={"frame 1": stretches})
    assert mended.verdict.is_found
    assert not mended.facts
    heavy = mended.verdict.lumps.set_index("name")["identified"]
    assert heavy.filter(like="m1").abs().max() == pytest.approx(0.24, rel=0.01)


def test_torque_that_never_changes_finds_nothing(tmp_path: Path) -> None:
    """A constant predicts it perfectly, whatever moves the robot: no body does better."""
    nominal = tmp_path / "pendulum.xml"
    nominal.write_text(PENDULUM.format(mass=0.7))
    log = log_of_hand(pushes=False)
    log["torque_1"] += 0.01 * np.random.default_rng(0).standard_normal(len(log))
    verdict = metaid.estimate(log, nominal).verdict
    assert verdict.word == "not found"
    assert "hardly change: a constant one predicts them as well as any body does" in verdict.reasons[-1]


def test_logs_of_one_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    """Else what is left out of one would be left out of both."""
    nominal, logs = tmp_path / "arm.xml", [tmp_path / folder / "log.csv" for folder in ("one", "two")]
    nominal.write_text(ARM.format(mass=1.2))
    for log in logs:
        log.parent.mkdir()
        log_of_motion().to_csv(log, index=False)
    result = metaid.estimate(logs, nominal, **ASKED, leave_out={"two/log.csv": [(7.0, 8.0)]})
    assert [record.name for record in result.records] == ["one/log.csv", "two/log.csv"]
    left_out = [any("left out, as asked" in each.text for each in record.repairs) for record in result.records]
    assert left_out == [False, True]


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
