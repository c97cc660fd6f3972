"""Units of times and angles are told by what machines do, or by what a column says."""

from __future__ import annotations

import numpy as np
import pytest

from metaid.errors import RecordError
from tests.clean_logs import clean, kinds, read


@pytest.mark.parametrize(("unit", "size"), [("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9)])
def test_usual_step_tells_the_unit_of_times(unit: str, size: float) -> None:
    """Since 1970 or since the start, and the unit is said; those in s are taken as they are."""
    usual, log = read(clean()), clean()
    assert kinds(usual) == []
    epoch = np.int64(1_700_000_000 / size)
    ticks = np.round(log["time"] / size).astype("int64") + epoch
    record = read(log.assign(time=ticks))
    np.testing.assert_allclose(record.times, usual.times, atol=1e-9)
    assert [repair.text for repair in record.repairs] == [f"times are in {unit}: the log has 200 Hz"]


def test_speeds_tell_between_two_units() -> None:
    """Steps of 0.1 are 10 Hz in s or 10 kHz in ms."""
    slow, fast = clean(60.0, 10.0), clean(1.0, 10_000.0)
    assert kinds(read(slow)) == []
    assert kinds(read(fast.assign(time=1e3 * fast["time"]))) == ["unit of times"]


def test_joint_without_an_end_may_turn_many_times() -> None:
    """As fast as machines do: what is faster is in degrees."""
    log = clean().drop(columns=["speed_1", "speed_2"])
    spun = log.assign(angle_1=log["angle_1"] + 20.0 * log["time"])
    endless = np.array([True, False])
    np.testing.assert_allclose(read(spun, endless=endless).angles[:, 0], spun["angle_1"])
    with pytest.raises(RecordError, match="looks like degrees"):
        read(spun, endless=~endless)
    with pytest.raises(RecordError, match="looks like degrees"):
        read(log.assign(angle_1=np.rad2deg(log["angle_1"])), endless=endless)


@pytest.mark.parametrize("size", [0.01, 0.028, 0.1])
def test_speeds_of_a_joint_that_hardly_moves_beyond_its_noise_are_taken(size: float) -> None:
    """The few changes that are larger than its noise are those that it has made larger."""
    random, log = np.random.default_rng(0), clean()
    angles = size * np.sin(3.1 * log["time"]) + 1e-3 * random.standard_normal(len(log))
    record = read(log.assign(angle_1=angles, speed_1=3.1 * size * np.cos(3.1 * log["time"])))
    assert record.speeds is not None


def test_speeds_of_a_joint_within_two_steps_of_its_encoder_are_taken() -> None:
    """Its angle jumps by a step, or not at all; the filter of its speeds knows nothing of steps."""
    log = clean()
    angles = 1e-4 * np.round(1.4 * np.sin(3.1 * log["time"]))
    record = read(log.assign(angle_1=0.3 + angles, speed_1=1e-4 * np.cos(3.1 * log["time"])))
    assert record.speeds is not None


def test_speeds_of_a_joint_that_is_held_and_shaken_are_taken() -> None:
    """Their sensor is filtered, and smaller than how fast the angle changes that others shake."""
    log = clean()
    shaken = {"angle_1": 1e-4 * np.sin(9.0 * log["time"]), "speed_1": 4e-4 * np.cos(9.0 * log["time"])}
    assert read(log.assign(**shaken)).speeds is not None
    with pytest.raises(RecordError, match=r"speed_1 is 0\.444 times how fast angle_1 changes"):
        read(log.assign(**{name: 1e3 * values for name, values in shaken.items()}))


def test_wrong_rate_is_told_where_all_speeds_are_as_many_times_too_fast() -> None:
    """Where they are not, a unit is wrong."""
    log = clean().drop(columns="time")
    with pytest.raises(RecordError, match=r"speed_1 is 4 times how fast .*, or --rate of about 200\)"):
        read(log, rate=50.0)
    with pytest.raises(RecordError, match=r"takes other units\)"):
        read(log.assign(speed_2=4.0 * log["speed_2"]), rate=200.0)


def test_column_that_says_radians_may_turn_many_times() -> None:
    """As that of a motor; one that says no unit may not."""
    log = clean().assign(angle_1=lambda frame: 60.0 * frame["angle_1"], speed_1=lambda frame: 60.0 * frame["speed_1"])
    with pytest.raises(RecordError, match="looks like degrees"):
        read(log)
    for names in (["Angle 1 (rad)", "Speed 1 (rad/sec)"], ["angle1_rad", "speed_1"]):
        said = log.rename(columns=dict(zip(["angle_1", "speed_1"], names, strict=True)))
        np.testing.assert_allclose(read(said).angles[:, 0], log["angle_1"])


@pytest.mark.parametrize(
    ("kind", "spelled", "size"),
    [
        *(("angle", each, np.pi / 180.0) for each in ("angle_1 [deg]", "angle1_deg", "pos (°) 1", "qDeg1")),
        ("angle", "angle_1 (mrad)", 1e-3),
        ("angle", "turns_q1", 2.0 * np.pi),
        *(("speed", each, np.pi / 30.0) for each in ("speed_1 [rpm]", "dq1_rpm", "velocity 1 (rev/min)")),
        *(("speed", each, np.pi / 180.0) for each in ("speed_1 [deg/s]", "dq_1_deg_per_s", "velDps1")),
        *(("torque", each, 1e-3) for each in ("torque_1 [mNm]", "tau1_mNm", "effort 1 (mN·m)")),
        ("torque", "torque_1_Ncm", 1e-2),
    ],
)
def test_unit_in_the_name_of_a_column_is_taken(kind: str, spelled: str, size: float) -> None:
    """And it is said; readings of the other joint stay in ours."""
    usual = read(clean())
    log = clean().assign(**{f"{kind}_1": clean()[f"{kind}_1"] / size}).rename(columns={f"{kind}_1": spelled})
    log = log.rename(columns={f"{kind}_2": spelled.replace("1", "2")})
    log[spelled.replace("1", "2")] /= size
    record = read(log)
    for name in ("angles", "speeds", "torques"):
        np.testing.assert_allclose(getattr(record, name), getattr(usual, name), rtol=1e-12)
    assert record.repairs[-1].text.startswith(f"{spelled} to {spelled.replace('1', '2')} are in ")


def test_joint_that_is_called_as_a_unit_is_none() -> None:
    """Its name is not what its readings are in; a unit beside it is."""
    log = clean().rename(columns=lambda column: column.replace("_1", "_turn").replace("_2", "_rev"))
    for joints, scale in ((log, 1.0), (log.rename(columns={"angle_turn": "angle_turn_mrad"}), 1e3)):
        given = joints.rename(columns={"speed_turn": "ignored"}).drop(columns=["ignored", "speed_rev"])
        first = next(column for column in given if "turn" in column)
        record = read(given.assign(**{first: scale * given[first]}), joints=("turn", "rev"))
        np.testing.assert_allclose(record.angles, clean()[["angle_1", "angle_2"]], atol=1e-9)


def test_user_says_the_unit_of_columns_whose_names_do_not() -> None:
    """All of a word at once, or one by one; another unit is refused with those that there are."""
    usual, log = read(clean()), clean()
    turned = {name: np.rad2deg(log[name]) for name in ("angle_1", "angle_2")}
    record = read(log.assign(**turned), columns={"angle": "angle:deg"})
    np.testing.assert_allclose(record.angles, usual.angles, rtol=1e-12)
    record = read(log.assign(angle_2=turned["angle_2"]), columns={"angle_2": "angle_2:deg"})
    np.testing.assert_allclose(record.angles, usual.angles, rtol=1e-12)
    fast = clean(1.0, 10_000.0).drop(columns=["speed_1", "speed_2"])
    fast = fast.assign(time=1e3 * fast["time"])  # may be 10 Hz in s as well
    for mapping, period in (({}, 0.1), ({"time": "time:ms"}, 1e-4)):
        np.testing.assert_allclose(read(fast, columns=mapping).period, period, rtol=1e-9)
    with pytest.raises(RecordError, match=r"unknown unit 'h'.*\(allowed: s, ms, us, ns\)"):
        read(log, columns={"time": "time:h"})
    with pytest.raises(RecordError, match=r"unknown unit 'grad'.*\(allowed: rad, mrad, deg, turn, m, mm\)"):
        read(log, columns={"angle": "angle:grad"})


def test_wheel_may_turn_as_many_degrees_as_its_column_says() -> None:
    log = clean().drop(columns=["speed_1", "speed_2"]).assign(angle_1=lambda own: own["angle_1"] + 70.0 * own["time"])
    degrees = log.assign(angle_1=np.degrees(log["angle_1"])).rename(columns={"angle_1": "angle_1_deg"})
    np.testing.assert_allclose(read(degrees).angles[:, 0], log["angle_1"], atol=1e-9)


def test_unit_that_a_name_says_wrongly_is_refused_by_the_speeds() -> None:
    """Angles in rad whose column says that they are in degrees."""
    with pytest.raises(RecordError, match=r"times how fast angle_1_deg changes, which looks like degrees"):
        read(clean().rename(columns={"angle_1": "angle_1_deg", "angle_2": "angle_2_deg"}))


def test_angles_that_the_user_says_are_radians_may_be_of_many_turns() -> None:
    """A pendulum that spins faster than any does by itself."""
    times = np.arange(0.0, 8.0, 0.005)
    log = clean().assign(angle_1=np.sin(times) + 70.0 * times).drop(columns=["speed_1", "speed_2"])
    with pytest.raises(RecordError, match=r"looks like degrees .*OWN=angle:deg takes degrees, OWN=angle:rad radians\)"):
        read(log, endless=True)
    record = read(log, endless=True, columns={"angle": "angle:rad"})
    np.testing.assert_allclose(record.angles[:, 0], log["angle_1"])
