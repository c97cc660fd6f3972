"""Joints without a motor tell bodies, too: what acts in them is known to be nothing.

Machines are simulated here by equations of their own, with encoders of 0.38 mrad: a double pendulum with one motor, as
pendubots and acrobots have, and a rotary pendulum.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest
from swinging import SAID

import metaid
from metaid.errors import RecordError
from metaid.models import Array
from metaid.recorded import RecordedResult

pytestmark = pytest.mark.slow

SECONDS, STEP, SUBSTEPS = 12.0, 0.005, 2  # s of a log, and between two rows, and Runge-Kutta steps in it
ENCODER = 0.38e-3  # rad
GRAVITY = 9.81
Pair = tuple[float, float]
Accelerate = Callable[[float, float, float, float, Pair], Pair]

MASS, LENGTH, COM, INERTIA = (0.6, 0.63), (0.3, 0.2), (0.22, 0.18), (0.006, 0.0035)
LUMPS = {
    "gravity_1": MASS[0] * COM[0] + MASS[1] * LENGTH[0],
    "gravity_2": MASS[1] * COM[1],
    "coriolis_1_2": LENGTH[0] * MASS[1] * COM[1],
    "inertia_1": INERTIA[0] + MASS[0] * COM[0] ** 2 + MASS[1] * LENGTH[0] ** 2,
    "inertia_2": INERTIA[1] + MASS[1] * COM[1] ** 2,
}
BELIEVED = {
    "gravity": GRAVITY,
    "links": [
        {"length": 0.3, "mass": 0.7, "com": 0.2, "inertia": 0.005},
        {"length": 0.2, "mass": 0.5, "com": 0.15, "inertia": 0.003},
    ],
}
ROTARY = {"arm": 0.0009, "mass": 0.024, "length": 0.085, "com": 0.0645, "inertia": 0.000133}
ROTARY_FILE = """<mujoco><compiler angle="radian"/><worldbody><body>
<joint name="arm" axis="0 0 1"/><inertial pos="0.04 0 0" mass="0.1" diaginertia="2e-5 2e-4 2e-4"/>
<body pos="0.085 0 0"><joint name="pendulum" axis="-1 0 0"/>
<inertial pos="0 0 0.05" mass="0.03" diaginertia="3e-5 3e-5 1e-6"/></body></body></worldbody></mujoco>"""


def double_pendulum(first: float, second: float, speed: float, other: float, torques: Pair) -> Pair:
    """Accelerations of the double pendulum; the first angle is from where it hangs, the second between its links."""
    own, cosine, sine = LUMPS["inertia_2"], np.cos(second), np.sin(second)
    cosine, sine = LUMPS["coriolis_1_2"] * cosine, LUMPS["coriolis_1_2"] * sine
    outer = LUMPS["gravity_2"] * GRAVITY * np.sin(first + second)
    inner = LUMPS["gravity_1"] * GRAVITY * np.sin(first) + outer
    push = torques[0] + sine * (2.0 * speed * other + other**2) - inner - 0.008 * speed - 0.03 * np.tanh(50.0 * speed)
    pull = torques[1] - sine * speed**2 - outer - 0.005 * other - 0.02 * np.tanh(50.0 * other)
    return solved(LUMPS["inertia_1"] + own + 2.0 * cosine, own + cosine, own, push, pull)


def rotary_pendulum(first: float, second: float, speed: float, other: float, torques: Pair) -> Pair:
    """Those of the rotary pendulum; the second angle is from the upright."""
    arm, mass, length, com, inertia = ROTARY.values()
    cosine, sine, across = np.cos(second), np.sin(second), mass * length * com
    turning = inertia * sine * cosine * speed
    push = torques[0] - 2.0 * turning * other + across * sine * other**2 - 0.0003 * speed
    pull = torques[1] + turning * speed + mass * GRAVITY * com * sine - 2e-5 * other
    return solved(arm + mass * length**2 + inertia * sine**2, across * cosine, inertia, push, pull)


def one_link(first: float, second: float, speed: float, other: float, torques: Pair) -> Pair:
    """Those of the first link without the second, whose angle stays."""
    push = torques[0] - MASS[0] * COM[0] * GRAVITY * np.sin(first) - 0.01 * speed
    return push / (INERTIA[0] + MASS[0] * COM[0] ** 2), 0.0


WHEEL = {"m1z": -0.4 * 0.12, "yy1": 0.008, "yy2": 2e-4}
WHEEL_FILE = """<mujoco><compiler angle="radian"/><worldbody><body><joint name="pivot" axis="0 1 0"/>
<inertial pos="0 0 -0.1" mass="0.5" diaginertia="1e-3 1e-3 5e-4"/><body pos="0 0 -0.15">
<joint name="wheel" axis="0 1 0"/><inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 2e-4 1e-4"/></body></body>
</worldbody></mujoco>"""


def wheel_pendulum(first: float, second: float, speed: float, other: float, torques: Pair) -> Pair:
    """Those of a pendulum that hangs, with a wheel at its end: no angle of the wheel matters."""
    weight, inertia, wheel = WHEEL.values()
    push = weight * GRAVITY * np.sin(first) - 5e-4 * speed - torques[1] + 2e-5 * other
    return push / inertia, (torques[1] - 2e-5 * other) / wheel - push / inertia


CART_POLE = """<mujoco><option timestep="0.002" integrator="RK4"/><worldbody>
<body><joint name="cart" type="slide" axis="1 0 0" armature="{motor}" damping="{damping}"/>
<inertial pos="0 0 0" mass="0.23" diaginertia="1e-3 1e-3 1e-3"/><body><joint name="pole" axis="0 1 0"/>
<inertial pos="0 0 {com}" mass="{mass}" diaginertia="0.0012 0.0012 1e-5"/></body></body>
</worldbody><actuator><motor joint="cart"/></actuator></mujoco>"""
POLE = {"mass": 0.08, "com": 0.2}


def cart_pole(seed: int) -> pd.DataFrame:
    """The log of a cart that a motor moves which is 60 times as heavy, 50 times a second: the angle of its pole has 15
    mrad of noise, and what the motor is sent, up to 1, makes 40 N.
    """
    model = mujoco.MjModel.from_xml_string(CART_POLE.format(motor=20.0, damping=12.0, **POLE))
    data, random = mujoco.MjData(model), np.random.default_rng(seed)
    data.qpos[1], rows = np.pi - 0.3, []
    phases, rates = random.uniform(0.0, 6.0, 4), random.uniform(3.0, 7.5, 4)
    for row in range(350):
        sent = np.clip(0.5 * np.sin(rates * 0.02 * row + phases).sum() - data.qpos[0], -1.0, 1.0)
        rows.append([0.02 * row, *(data.qpos + (1e-4, 0.015) * random.standard_normal(2)), sent])
        for _ in range(10):
            data.ctrl[:] = 40.0 * sent
            mujoco.mj_step(model, data)
    return pd.DataFrame(rows, columns=["time", "angle_cart", "angle_pole", "torque_cart"])


@pytest.mark.parametrize("seed", [0, 1])
def test_weight_of_a_pole_is_not_lost_in_the_noise_of_its_angle(seed: int, tmp_path: Path) -> None:
    """Though all that tells it is by how little its cart moves otherwise."""
    nominal = tmp_path / "cart.xml"
    nominal.write_text(CART_POLE.format(motor=0.0, damping=0.0, mass=0.1, com=0.17))
    values = metaid.estimate(cart_pole(seed), nominal).verdict.lumps.set_index("name")["identified"]
    weight = POLE["mass"] * POLE["com"]
    assert values["m2z"] == pytest.approx(weight / 40.0, rel=0.15)
    assert values["m2z"] / values["yy2"] == pytest.approx(weight / (0.0012 + weight * POLE["com"]), rel=0.02)


def solved(one: float, both: float, other: float, push: float, pull: float) -> Pair:
    """What a mass matrix of two joints makes of two torques."""
    size = one * other - both**2
    return (other * push - both * pull) / size, (one * pull - both * push) / size


def moved(accelerate: Accelerate, start: float, largest: Pair, seed: int, hertz: float = 1.2) -> pd.DataFrame:
    """The log of a machine that is driven by sinusoids (of two amplitudes, in N m), as its encoders read it.
    Its second angle begins at `start`.
    """
    random = np.random.default_rng(seed)
    rates, phases = 2.0 * np.pi * random.uniform(0.15, hertz, 5), random.uniform(0.0, 6.0, 5)
    state, rows, step = np.array([0.0, start, 0.0, 0.0]), [], STEP / SUBSTEPS

    def rate(state: Array, torques: Pair) -> Array:
        return np.array([*state[2:], *accelerate(*state.tolist(), torques)])

    for row in range(round(SECONDS / STEP)):
        wave = float(np.sin(rates * row * STEP + phases).sum())
        one, other = (
            (each * wave - 0.002 * angle) if each else 0.0 for each, angle in zip(largest, state, strict=False)
        )
        torques = one, other
        rows.append([row * STEP, *np.round(state[:2] / ENCODER) * ENCODER, *torques])
        for _ in range(SUBSTEPS):
            first = rate(state, torques)
            second = rate(state + 0.5 * step * first, torques)
            third = rate(state + 0.5 * step * second, torques)
            fourth = rate(state + step * third, torques)
            state = state + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
    return pd.DataFrame(rows, columns=["time", "angle_1", "angle_2", "torque_1", "torque_2"])


@cache
def swung(driven: int) -> list[pd.DataFrame]:
    """Two logs of the double pendulum with a motor in one joint."""
    largest = (0.14, 0.0) if driven == 0 else (0.0, 0.07)
    return [moved(double_pendulum, 0.0, largest, seed) for seed in (0, 1)]


def worst(found: RecordedResult, true: dict[str, float], names: Iterable[str]) -> float:
    """The largest relative error of parameters of these `names`."""
    values = found.verdict.lumps.set_index("name")["identified"]
    return max(abs(float(values[name]) / true[name] - 1.0) for name in names)


@pytest.mark.parametrize("driven", [0, 1])
def test_double_pendulum_with_one_motor_is_identified(driven: int) -> None:
    """By its first joint or by its second, whose torque says nothing of the first link."""
    found = metaid.estimate(swung(driven), BELIEVED, zero={"1": np.pi}, friction=("viscous", "coulomb"))
    assert found.verdict.word != "not found"
    assert worst(found, LUMPS, ("gravity_1", "gravity_2")) < 0.01
    table = found.verdict.lumps.set_index("name").loc[[*LUMPS]]
    missed = (table["identified"] - pd.Series(LUMPS)).abs()
    assert (missed < 2.0 * np.hypot(table["sd"], table["sd_systematic"])).all()
    assert found.estimate.held_out.relative < 0.02
    assert found.summary["held_out"]["motion"]["angle"][driven] < 0.005  # rad
    other = 2 - driven
    assert any(f"the torque of joint {other} is 0, as without a motor" in reason for reason in found.verdict.reasons)


def test_rotary_pendulum_needs_no_column_for_a_motor_that_it_has_not(tmp_path: Path) -> None:
    """And the log says so, though its encoder counts the other way. Gravity acts in the joint without one alone."""
    (tmp_path / "rotary.xml").write_text(ROTARY_FILE)
    logs = [moved(rotary_pendulum, np.pi, (0.003, 0.0), seed, 2.0).drop(columns="torque_2") for seed in (0, 1)]
    logs = [log.assign(angle_2=-log["angle_2"]) for log in logs]
    found = metaid.estimate(logs, tmp_path / "rotary.xml", reversed=["pendulum"])
    true = {"m2z": ROTARY["mass"] * ROTARY["com"], "xx2": ROTARY["inertia"]}
    true["zz1"] = ROTARY["arm"] + ROTARY["mass"] * ROTARY["length"] ** 2
    assert found.verdict.word != "not found"
    assert worst(found, true, true) < 0.05
    repairs = [repair["text"] for log in found.summary["logs"] for repair in log["repairs"]]
    assert repairs == ["no torque of joint pendulum: it is 0, as without a motor"] * 2


def test_wheel_that_turns_on_and_on_makes_its_pendulum_no_joint_that_is_held(tmp_path: Path) -> None:
    """It turns 130 times as far. By its file it has no thickness, and the log says of its columns but the units."""
    (tmp_path / "wheel.xml").write_text(WHEEL_FILE)
    log = moved(wheel_pendulum, 0.3, (0.0, 0.02), 0)
    assert np.ptp(log["angle_2"]) > 100.0 * np.ptp(log["angle_1"])
    log.columns = ["t_s", "pivot_rad", "wheel_rad", "pivot_Nm", "wheel_Nm"]
    found = metaid.estimate(log, tmp_path / "wheel.xml", **SAID)
    assert found.verdict.word != "not found"
    assert worst(found, WHEEL, WHEEL) < 0.01


def test_motor_whose_torque_was_not_logged_is_no_joint_without_one() -> None:
    """It is named, with the option that leaves its torque out."""
    log = moved(double_pendulum, 0.0, (0.1, 0.1), 0).assign(torque_2=0.0)
    found = metaid.estimate(log, BELIEVED, zero={"1": np.pi}, **SAID)
    assert any("--untrusted 2 " in reason for reason in found.verdict.reasons)


def test_motor_is_not_named_beside_a_wrong_zero_that_leaves_as_much_of_a_joint_without_one() -> None:
    log = moved(double_pendulum, 0.0, (0.1, 0.0), 0).drop(columns="torque_2")
    reasons = metaid.estimate(log, BELIEVED, **SAID).verdict.reasons
    assert any("the zero of joint 1 is off by 180°" in each for each in reasons)
    assert not any("a motor seems to move it" in each for each in reasons)


def test_rotary_pendulum_whose_encoder_counts_the_other_way_is_named(tmp_path: Path) -> None:
    """With the option that mends it."""
    (tmp_path / "rotary.xml").write_text(ROTARY_FILE)
    log = moved(rotary_pendulum, np.pi, (0.003, 0.0), 0, 2.0)
    found = metaid.estimate(log.assign(angle_2=-log["angle_2"]), tmp_path / "rotary.xml", **SAID)
    assert any("joint pendulum counts the other way: --reversed pendulum" in each for each in found.verdict.reasons)


def test_gravity_that_is_said_wrong_of_a_rotary_pendulum_is_named(tmp_path: Path) -> None:
    """Where it points elsewhere its second joint has no motor, too."""
    (tmp_path / "rotary.xml").write_text(ROTARY_FILE)
    log = moved(rotary_pendulum, np.pi, (0.003, 0.0), 0, 2.0).assign(angle_2=lambda own: -own["angle_2"])
    found = metaid.estimate(log, tmp_path / "rotary.xml", reversed=["pendulum"], gravity=(9.81, 0.0, 0.0), **SAID)
    assert any("--gravity 0,0,-9.81" in each for each in found.verdict.reasons), found.verdict.reasons


@pytest.mark.parametrize("nlink", [1, 2])
def test_pendulum_that_was_zeroed_where_it_hangs_is_named(nlink: int) -> None:
    """Though a single link whose mass is on the other side moves alike."""
    (log, *_) = swung(0)
    if nlink == 1:
        log = moved(one_link, 0.0, (0.1, 0.0), 0)[["time", "angle_1", "torque_1"]]
    believed = {**BELIEVED, "links": BELIEVED["links"][:nlink]}  # type: ignore[index]
    found = metaid.estimate(log, believed, **SAID)
    assert any("--zero 1=3.1416" in reason for reason in found.verdict.reasons)


TORQUES = ["torque_1", "torque_2"]


@cache
def released() -> pd.DataFrame:
    """The log of the double pendulum that swings freely from where its second link points up, with no torques."""
    return moved(double_pendulum, 2.5, (0.0, 0.0), 0).drop(columns=TORQUES)


def test_pendulum_that_swings_freely_is_identified_but_for_its_weight() -> None:
    """All bodies together are taken to weigh what the nominal ones do: lumps are as many times what they are, and what
    follows from a state does not depend on it.
    """
    found = metaid.estimate(released(), BELIEVED, zero={"1": np.pi})
    values = found.verdict.lumps.set_index("name")["identified"][[*LUMPS]] / pd.Series(LUMPS)
    assert found.verdict.word == "approximate"
    assert values.max() / values.min() - 1.0 < 0.005
    assert max(found.summary["held_out"]["motion"]["angle"]) < 0.03  # rad
    assert found.verdict.reasons[0].startswith("terms that cancel of parts that were left out are predicted to")
    assert found.verdict.reasons[-1].startswith("no log has a torque: what all bodies weigh together")
    shown = found.left_out[0]
    gravity, left = (
        np.abs(each[shown.judged]).max(axis=0) for each in (shown.measured, shown.measured - shown.predicted)
    )
    assert (left < 0.1 * gravity).all()
    assert (gravity > 0.5).all()  # N m
    (repair,) = [each["text"] for each in found.summary["logs"][0]["repairs"]]
    assert repair.startswith("no torques: taken to swing freely")


def test_pendulum_whose_torques_were_not_logged_does_not_swing_freely() -> None:
    """Motors are named."""
    log = moved(double_pendulum, 0.0, (0.1, 0.1), 0).drop(columns=TORQUES)
    found = metaid.estimate(log, BELIEVED, zero={"1": np.pi}, **SAID)
    assert any("name the columns of torques, with --map OWN=torque" in reason for reason in found.verdict.reasons)


def test_logs_with_and_without_torques_are_refused() -> None:
    """Torques that were forgotten in one would spoil what the other says."""
    still = released().assign(**dict.fromkeys(TORQUES, 0.0))
    with pytest.raises(
        RecordError, match=r"frame 2: every torque is 0, and not in other logs \(allowed: torques in all"
    ):
        metaid.estimate([swung(0)[0], still], BELIEVED)
    with pytest.raises(RecordError, match="frame 2: no column 'torque_1'"):
        metaid.estimate([swung(0)[0], released()], BELIEVED)


def test_files_of_a_pendulum_that_have_some_kinds_of_readings_each_are_one_log() -> None:
    """Its torques are in the second; two that have none are two logs."""
    given = {"zero": {"1": np.pi}, **SAID}
    log = swung(0)[0]
    apart = [log.drop(columns=TORQUES), log[["time", *TORQUES]]]
    usual, merged = (metaid.estimate(each, BELIEVED, **given) for each in (log, apart))
    np.testing.assert_array_equal(merged.estimate.values, usual.estimate.values)
    assert len(metaid.estimate([released(), released()[:1200]], BELIEVED, **given).records) == 2


def test_what_is_true_of_all_files_of_one_log_is_said_once(tmp_path: Path) -> None:
    log, paths = swung(0)[0], [tmp_path / "angles.txt", tmp_path / "torques.txt"]
    for path, each in zip(paths, [log.drop(columns=TORQUES), log[["time", *TORQUES]]], strict=True):
        each.to_csv(path, sep=" ", index=False)
    (own,) = metaid.estimate(paths, BELIEVED, zero={"1": np.pi}, **SAID).summary["logs"]
    assert [each["text"] for each in own["repairs"]].count("columns are separated by blanks") == 1


@pytest.mark.parametrize(
    ("torques", "message"),
    [({}, "no column 'torque_1'"), (dict.fromkeys(TORQUES, 0.0), "every torque is 0, so nothing")],
)
def test_arm_needs_torques(tmp_path: Path, torques: dict[str, float], message: str) -> None:
    """What swings freely is a pendulum."""
    (tmp_path / "rotary.xml").write_text(ROTARY_FILE)
    with pytest.raises(RecordError, match=message):
        metaid.estimate(released().assign(**torques), tmp_path / "rotary.xml")
