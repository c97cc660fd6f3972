"""Logs as people have them are read alike, whatever they are written in, and what was understood or mended is said."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from metaid.errors import RecordError
from metaid.recorded import Intake, Record, every_run

Change = Callable[[pd.DataFrame], pd.DataFrame]


def clean(seconds: float = 8.0, rate: float = 200.0, seed: int = 0) -> pd.DataFrame:
    """A log of two joints that swing, speeds included, with 0.1 mrad of noise."""
    random = np.random.default_rng(seed)
    times = np.arange(round(seconds * rate)) / rate
    columns = {"time": times}
    for joint, pulse in ((1, 3.1), (2, 5.3)):
        columns[f"angle_{joint}"] = np.sin(pulse * times) + 1e-4 * random.standard_normal(len(times))
        columns[f"speed_{joint}"] = pulse * np.cos(pulse * times) + 1e-3 * random.standard_normal(len(times))
        columns[f"torque_{joint}"] = np.cos(2.0 * pulse * times) + 1e-2 * random.standard_normal(len(times))
    return pd.DataFrame(columns)


def intake(joints: tuple[str, ...] = ("1", "2"), **given: object) -> Intake:
    return Intake(joints, np.zeros(len(joints), dtype=bool), **given)  # type: ignore[arg-type]


def read(log: pd.DataFrame | str, **given: object) -> Record:
    """The one run in a log."""
    (record,) = intake(**given).read(log)  # type: ignore[arg-type]
    return record


def kinds(record: Record) -> list[str]:
    return [repair.kind for repair in record.repairs]


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


SPELLED: dict[str, tuple[dict[str, str], list[str]]] = {
    "DFKI": ({"time": "time", "angle_": "pos_meas", "speed_": "vel_meas", "torque_": "tau_meas"}, ["1", "2"]),
    "short": ({"time": "t", "angle_": "q", "speed_": "dq", "torque_": "tau"}, ["1", "2"]),
    "underscores": ({"time": "timestamp", "angle_": "pos_", "speed_": "vel_", "torque_": "tau_"}, ["1", "2"]),
    "RTDE": ({"time": "timestamp", "angle_": "actual_q_", "speed_": "actual_qd_", "torque_": "effort_"}, ["0", "1"]),
    "brackets": ({"time": "Time [s]", "angle_": "Position", "speed_": "Velocity", "torque_": "Torque"}, ["[0]", "[1]"]),
    "PlotJuggler": (
        {"time": "__time", "angle_": "/joint_states/{}/position", "speed_": "/joint_states/{}/velocity"}
        | {"torque_": "/joint_states/{}/effort"},
        ["shoulder_joint", "elbow_joint"],
    ),
    "cart": ({"time": "t", "angle_": "pos_", "speed_": "vel_", "torque_": "force_"}, ["cart", "pole"]),
    "ROS": ({"time": "stamp", "angle_": "position_", "speed_": "velocity_", "torque_": "effort_"}, ["elbow", "hand"]),
}


def respelled(log: pd.DataFrame, how: str) -> pd.DataFrame:
    words, joints = SPELLED[how]
    names = {}
    for column in log.columns:
        kind, _, joint = str(column).partition("_")
        own = words[f"{kind}_" if joint else kind]
        name = joints[int(joint) - 1] if joint else ""
        names[column] = own.format(name) if "{}" in own else own + name
    return log.rename(columns=names)


@pytest.mark.parametrize("how", SPELLED)
def test_columns_are_understood_as_people_spell_them(how: str) -> None:
    """By numbers from 0 or 1, or by names of joints; other columns are left alone, and it is said."""
    usual, joints = read(clean()), tuple(SPELLED[how][1])
    joints = joints if joints[0].isidentifier() else ("1", "2")
    log = respelled(clean(), how).assign(temperature_1=40.0, pos_des_1=0.0, gripper_position=0.1, note="a")
    record = read(log, joints=joints)
    for name in ("times", "angles", "speeds", "torques"):
        np.testing.assert_allclose(getattr(record, name), getattr(usual, name), atol=1e-12)
    assert kinds(record) == ["columns"]


@pytest.mark.parametrize("what", ["current", "voltage"])
def test_what_a_motor_is_sent_stands_for_its_torque(what: str) -> None:
    """Where there is no torque, and that is said."""
    record = read(clean().rename(columns=lambda name: name.replace("torque", what)))
    np.testing.assert_array_equal(record.torques, clean()[["torque_1", "torque_2"]])
    assert any(repair.text.startswith(f"motor {what}s stand for torques: ") for repair in record.repairs)


def test_rows_that_have_readings_of_one_topic_each_are_one_log() -> None:
    """As exported of several topics: a torque holds until the next."""
    log, torques = clean(), ["torque_1", "torque_2"]
    later = log.iloc[::4].assign(time=log["time"].iloc[::4] + 0.001)
    sent = later[["time", *torques]].reset_index(drop=True)
    sparse = pd.concat([log.drop(columns=torques), sent]).sort_values("time", kind="stable")
    others = pd.DataFrame({"time": log["time"] + 0.002, "battery": 12.0})
    record = read(pd.concat([sparse, others]).sort_values("time", kind="stable"))
    np.testing.assert_array_equal(record.angles, log[["angle_1", "angle_2"]].iloc[1:])
    rows = (np.arange(1, len(log)) - 1) // 4
    np.testing.assert_array_equal(record.torques, sent[torques].to_numpy()[rows])
    assert kinds(record) == ["topics", "no number"]


def test_column_that_the_user_names_goes_before_one_that_is_understood() -> None:
    """As a command beside efforts that a driver leaves at 0; the other joint keeps its own."""
    log = clean().rename(columns=lambda name: name.replace("_1", "_elbow").replace("_2", "_hand"))
    log = log.assign(command=log["torque_elbow"], torque_elbow=0.0)
    record = read(log, joints=("elbow", "hand"), columns={"command": "torque_1"})
    np.testing.assert_array_equal(record.torques, clean()[["torque_1", "torque_2"]])


def test_columns_of_other_joints_are_passed_by_where_the_user_names_all() -> None:
    """As of a gripper, whose number is one of them."""
    log = clean().rename(columns={"angle_1": "q1", "angle_2": "q3", "torque_1": "u1", "torque_2": "u3"})
    log = log.assign(q2=0.0, u2=0.0).drop(columns=["speed_1", "speed_2"])
    with pytest.raises(RecordError, match="column 'q3' is of no joint"):
        read(log)
    named = {"q1": "angle_1", "q3": "angle_2", "u1": "torque_1", "u3": "torque_2"}
    np.testing.assert_array_equal(read(log, columns=named).angles, read(clean()).angles)


def test_words_of_a_log_stand_for_joints_that_have_but_numbers() -> None:
    """In the order of the columns; where these are not of all joints, no word stands for any."""
    log = clean().rename(columns=lambda name: name.replace("_1", "_shoulder").replace("_2", "_elbow"))
    np.testing.assert_array_equal(read(log).torques, read(clean()).torques)
    assert [repair.kind for repair in read(log).repairs] == ["columns"]
    with pytest.raises(RecordError, match="no column 'angle_1'"):
        read(log.rename(columns={"torque_elbow": "torque_wrist"}))


def test_joint_without_a_column_for_its_torque_has_none() -> None:
    """And that is said; without an angle a joint is no joint of the log."""
    record = read(clean().drop(columns="torque_2"))
    assert record.torques[:, 0].any()
    assert not record.torques[:, 1].any()
    assert [repair.text for repair in record.repairs] == ["no torque of joint 2: it is 0, as without a motor"]
    with pytest.raises(RecordError, match="no column 'angle_2' beside 'angle_1'"):
        read(clean().drop(columns="angle_2"))


def test_columns_of_one_joint_need_no_number() -> None:
    """As a bench of one joint writes them; of two joints nobody knows whose they are."""
    log = clean()[["time", "angle_1", "speed_1", "torque_1"]]
    bare = log.set_axis(["time", "position", "velocity", "torque"], axis=1)
    (usual,), (record,) = (intake(("shoulder",)).read(each) for each in (log, bare))
    for kind in ("angles", "speeds", "torques"):
        np.testing.assert_array_equal(getattr(record, kind), getattr(usual, kind))
    assert [each.text for each in record.repairs] == ["position is the angle; velocity is the speed"]
    with pytest.raises(RecordError, match="no column 'angle_1' among time, position, velocity, torque"):
        read(bare)


def test_column_of_no_joint_is_refused_in_its_own_spelling() -> None:
    """As where some joints of a robot are estimated, and the log numbers all of them."""
    log = clean()
    log = log.set_axis([name.replace("angle", "position") for name in log], axis=1).assign(position_3=0.0)
    said = (
        r"'position_3' is of no joint \(allowed: position_1 to position_2, or named as position_j2; or --map of all\)"
    )
    with pytest.raises(RecordError, match=said):
        intake(("j2", "j4")).read(log)
    odd = r"position_3' is of no joint \(allowed: position_1 to position_2, or named as position_\\1; or --map of all\)"
    with pytest.raises(RecordError, match=odd):
        intake(("\\1", "j4")).read(log)


def test_map_says_what_a_column_is() -> None:
    """A name that means nothing by itself; a wrong one is refused with what is allowed."""
    log = clean().rename(columns={"torque_1": "pwm a", "torque_2": "pwm b"})
    record = read(log, columns={"pwm a": "torque_1", "pwm b": "torque_2"})
    np.testing.assert_array_equal(record.torques, read(clean()).torques)
    for mapping, says in (
        ({"pwm c": "torque_1"}, "did you mean 'pwm b'?"),
        ({"pwm a": "torque_3"}, "did you mean 'torque_2'?"),
    ):
        with pytest.raises(RecordError, match="map") as refused:
            read(log, columns=mapping)
        assert says in str(refused.value)


WRITTEN: dict[str, Callable[[pd.DataFrame, Path], object]] = {
    "semicolons": lambda log, path: log.to_csv(path, index=False, sep=";", decimal=","),
    "byte order mark": lambda log, path: log.to_csv(path, index=False, encoding="utf-8-sig"),
    "tabs": lambda log, path: log.to_csv(path, index=False, sep="\t"),
    "blanks": lambda log, path: np.savetxt(path, log, header=" ".join(log.columns)),
    "UTF-16": lambda log, path: log.to_csv(path, index=False, sep="\t", encoding="utf-16"),
    "a title": lambda log, path: path.write_text("Log of 3 May\n\n" + log.to_csv(index=False)),
    "an index": lambda log, path: log.to_csv(path),
    "quotes": lambda log, path: log.to_csv(path, index=False, quoting=1),
}


@pytest.mark.parametrize("how", WRITTEN)
def test_text_is_read_as_it_is_written(how: str, tmp_path: Path) -> None:
    """Whatever separates columns, with decimal commas, a byte order mark, and a title above."""
    path = tmp_path / ("log.dat" if how == "blanks" else "log.csv")
    WRITTEN[how](clean(), path)
    record = read(str(path))
    usual = read(clean())
    np.testing.assert_allclose(record.angles, usual.angles, atol=1e-12)
    np.testing.assert_allclose(record.torques, usual.torques, atol=1e-12)
    assert kinds(record) == (["format"] if how in ("semicolons", "tabs", "blanks", "UTF-16") else [])


def arrays_of(log: pd.DataFrame) -> dict[str, np.ndarray]:
    """A log as its arrays, two joints wide."""
    return {
        own: log[[f"{kind}_1", f"{kind}_2"]].to_numpy()
        for own, kind in (("q", "angle"), ("dq", "speed"), ("tau", "torque"))
    }


@pytest.mark.parametrize("how", ["step", "structure", "lying", "lists", "records", "lines"])
def test_arrays_are_read_as_tables(how: str, tmp_path: Path) -> None:
    """Of NumPy with the step alone, of MATLAB in a structure, or with a column a time, of JSON in lists or in records;
    no numbers are passed by.
    """
    endings = {"step": "npz", "lists": "json", "records": "json", "lines": "jsonl"}
    log, path = clean(), tmp_path / f"run.{endings.get(how, 'mat')}"
    arrays, times = arrays_of(log), log["time"].to_numpy()
    rows = [
        {"time": time} | {name: each.tolist() for name, each in zip(arrays, row, strict=True)}
        for time, *row in zip(times.tolist(), *arrays.values(), strict=True)
    ]
    if how == "step":
        np.savez(path, **arrays, dt=0.005, mass=2.5, names=np.array(["a", "b"], dtype=object))
    elif how == "lists":
        path.write_text(
            json.dumps({"log": {"t": times.tolist(), "robot": "two"} | {n: a.tolist() for n, a in arrays.items()}})
        )
    elif how == "records":
        path.write_text(json.dumps({"robot": "two", "entries": rows}))
    elif how == "lines":
        path.write_text("\n".join(map(json.dumps, rows)))
    elif how == "structure":
        savemat(path, {"run": {"t": times, "note": "first", **arrays}})
    else:
        savemat(path, {"time": times[None], "Ts": 1.0} | {name: each.T for name, each in arrays.items()})
    usual, record = read(log), read(str(path))
    np.testing.assert_allclose(record.times, usual.times, atol=1e-12)
    np.testing.assert_array_equal(record.angles, usual.angles)
    np.testing.assert_array_equal(record.speeds, usual.speeds)
    np.testing.assert_array_equal(record.torques, usual.torques)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("run.npz", b"hello", "no file of NumPy's arrays: File is not a zip file"),
        ("run.mat", b"hello", "no file of MATLAB's: Mat file appears to be truncated"),
        ("run.mat", b"MATLAB 7.3".ljust(124) + b"\x00\x02IM".ljust(400), "of MATLAB 7.3, which is not read (allowed: "),
        ("run.json", b"{", "no JSON: Expecting property name"),
        ("run.mat", None, "No such file or directory (allowed: the path of a log)"),
    ],
)
def test_file_without_arrays_is_refused_in_one_line(
    name: str, content: bytes | None, says: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RecordError) as refused:
        read(str(path))
    assert str(refused.value).startswith(f"{path}: {says}")


def test_numbers_alone_are_no_log(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", mass=2.5)
    with pytest.raises(
        RecordError, match=r"no array has a row for each time, among mass \(allowed: arrays as t, q, tau"
    ):
        read(str(tmp_path / "run.npz"))


def test_rows_without_a_number_are_left_out_and_counted() -> None:
    """Empty cells, words and infinity, in any column."""
    log = clean().astype({"torque_2": object})
    log.loc[17, "angle_1"], log.loc[40, "torque_2"], log.loc[41, "speed_1"] = np.nan, "lost", np.inf
    record = read(log)
    assert len(record.times) == len(log) - 3
    assert record.repairs[0].text == "3 rows without a number left out, the first row 18: angle_1"


def test_disorder_and_repeated_rows_are_mended() -> None:
    """Rows are sorted by time, and one that is there twice is left out."""
    log, usual = clean(), read(clean())
    order = np.arange(len(log))
    order[[10, 11, 500, 501]] = order[[11, 10, 501, 500]]
    record = read(pd.concat([log.iloc[order], log.iloc[700:720]]).reset_index(drop=True))
    np.testing.assert_array_equal(record.times, usual.times)
    np.testing.assert_array_equal(record.angles, usual.angles)
    assert [(repair.kind, repair.count) for repair in record.repairs] == [("order", 3), ("repeated times", 20)]


def test_log_is_cut_into_runs_at_gaps_and_where_its_clock_was_set_back() -> None:
    """Each begins at 0, and the first says it."""
    log = clean()
    gap = log.assign(time=np.where(log["time"] < 4.0, log["time"], log["time"] + 1e6))
    again = log.assign(time=np.where(log["time"] < 4.0, log["time"], log["time"] - 4.0))
    for broken, kind in ((gap, "gaps"), (again, "clock")):
        first, second = intake().read(broken)
        assert len(first.times) == len(second.times) == 800
        assert second.times[0] == 0.0
        assert (kinds(first), first.repairs[0].count) == ([kind], 1)


@pytest.mark.parametrize("has_speeds", [True, False])
@pytest.mark.parametrize(("jitter", "lost"), [(0.0005, 0.0), (0.0005, 0.1), (0.002, 0.01)])
def test_readings_tell_the_clock_that_a_host_jitters(has_speeds: bool, jitter: float, lost: float) -> None:
    """Times are several times closer to the truth than the stamps, whatever packets were lost; both are counted."""
    random, log = np.random.default_rng(5), clean(20.0)
    kept = random.random(len(log)) >= lost
    stamps = np.maximum.accumulate(log["time"] + jitter * np.abs(random.standard_normal(len(log))))
    true, log = log["time"][kept], log.assign(time=stamps)[kept].reset_index(drop=True)
    record = read(log if has_speeds else log.drop(columns=["speed_1", "speed_2"]))
    assert len(record.times) == len(true)
    assert np.std(record.times - true) < 0.5 * np.std(log["time"].to_numpy() - true.to_numpy())
    assert "jitter" in kinds(record)
    if lost:
        counts = {repair.kind: repair.count for repair in record.repairs}
        assert counts["lost rows"] == pytest.approx((~kept).sum(), rel=0.2)


def test_clock_of_stamps_that_jitter_by_more_than_a_period_is_even() -> None:
    """Where speeds tell what was lost; one that follows the stamps at each row is off by three times as much."""
    log, random = clean(20.0, 500.0), np.random.default_rng(3)
    stamps = np.maximum.accumulate(log["time"] + 0.0024 * np.abs(random.standard_normal(len(log))))
    kept = np.random.default_rng(10).random(len(log)) >= 0.01
    record = read(log.assign(time=stamps)[kept].reset_index(drop=True))
    assert np.std(record.times - log["time"][kept].to_numpy()) < 0.05 * 0.002


def test_true_stamps_of_an_irregular_log_are_kept() -> None:
    """Readings that were taken when the stamps say stay where they are."""
    times = clean(20.0)["time"].to_numpy()
    times = times + 5e-4 * np.random.default_rng(0).standard_normal(len(times))
    columns = {"time": times - times[0]}
    for joint, pulse in ((1, 3.1), (2, 5.3)):
        columns |= {f"angle_{joint}": np.sin(pulse * times), f"torque_{joint}": np.cos(pulse * times)}
    record = read(pd.DataFrame(columns))
    np.testing.assert_array_equal(record.times, columns["time"])


def test_rows_that_repeat_readings_of_a_moving_robot_are_left_out() -> None:
    """A packet that was written twice with other stamps; at rest readings may be the same."""
    log = clean().round(4)
    twice = np.sort(np.concatenate([np.arange(len(log)), np.arange(100, 1500, 50)]))
    doubled = log.iloc[twice].reset_index(drop=True)
    doubled["time"] = log["time"][0] + np.arange(len(doubled)) / 200.0
    record = read(doubled)
    assert (record.repairs[0].kind, record.repairs[0].count) == ("repeated rows", 28)
    np.testing.assert_allclose(record.angles, log[["angle_1", "angle_2"]])


def test_angles_that_are_read_more_seldom_than_the_log_has_rows_are_read_once() -> None:
    """Of a controller that logs three rows to each reading, with speeds that are 0 but in the first; torques are what
    they were on average.
    """
    log = clean().iloc[:1500]
    first = np.arange(len(log)) // 3 * 3
    held = log.iloc[first].reset_index(drop=True).assign(time=log["time"], torque_1=log["torque_1"])
    held[["speed_1", "speed_2"]] *= 3.0 * (first == log.index)[:, None]
    record = read(held)
    assert [(repair.kind, repair.count) for repair in record.repairs] == [("repeated rows", 1000)]
    assert record.speeds is not None
    np.testing.assert_array_equal(record.angles, log[["angle_1", "angle_2"]][::3])
    np.testing.assert_allclose(record.speeds, log[["speed_1", "speed_2"]][::3])
    np.testing.assert_allclose(record.torques[:, 0], log["torque_1"].to_numpy().reshape(-1, 3).mean(axis=1))


@pytest.mark.parametrize("size", [0.1, 3.0, 1e6])
def test_lone_wild_readings_are_replaced_by_what_their_neighbours_say(size: float) -> None:
    """Of angles, speeds and torques, each counted; no other reading is touched."""
    log, usual = clean(), read(clean())
    spoiled, rows = log.copy(), [50, 700, 1400]
    for column in ("angle_1", "speed_2", "torque_1"):
        spoiled.loc[rows, column] += size if column == "angle_1" else 8.0 * size
    record = read(spoiled)
    assert [(repair.kind, repair.count) for repair in record.repairs] == [("wild", 3)] * 3
    assert np.abs(record.angles - usual.angles).max() < 1e-3
    others = np.delete(np.arange(len(log)), rows)
    np.testing.assert_array_equal(record.torques[others], usual.torques[others])


def test_reading_of_a_robot_that_stops_at_once_is_no_wild_one() -> None:
    """As of an arm whose brakes close: torques and speeds are others after it than before."""
    log = clean()
    stopped = log["time"] >= 5.0
    for column, jerk in (("speed_1", 3.0), ("torque_1", -2.0)):
        log.loc[stopped, column] = 0.01 * log.loc[stopped, column]
        log.loc[stopped.idxmax(), column] = jerk
    log.loc[stopped, "angle_1"] = log["angle_1"][stopped.idxmax()]
    record = read(log)
    assert "wild" not in kinds(record)
    np.testing.assert_array_equal(record.torques, log[["torque_1", "torque_2"]])


def test_broken_sensor_is_refused() -> None:
    """One that is wild too often, and an angle that jumps farther than any joint turns."""
    for change, says in (
        (lambda log: log.assign(angle_1=log["angle_1"] + 0.5 * (np.arange(len(log)) % 20 == 0)), "wild readings"),
        (lambda log: log.assign(angle_1=log["angle_1"] + 2.0 * (np.arange(len(log)) > 800)), "angle_1 jumps by 2"),
    ):
        with pytest.raises(RecordError, match=says):
            read(change(clean()))


def test_torques_that_a_controller_sends_in_steps_are_kept() -> None:
    """Every tenth as large as the motor can, where what it follows jumps: that is no broken sensor."""
    log = clean()
    log.loc[log.index % 10 == 0, "torque_1"] += 30.0
    record = read(log)
    assert [(repair.kind, repair.text.partition(" ")[0]) for repair in record.repairs] == [("steps", "torque_1")]
    np.testing.assert_array_equal(record.torques, log[["torque_1", "torque_2"]])


def test_angles_that_were_cut_at_a_full_turn_go_on() -> None:
    """As of an encoder that says −π to π."""
    log = clean()
    whole = 3.0 * log["angle_1"] + 1.0
    usual = read(log.assign(angle_1=whole, speed_1=3.0 * log["speed_1"]))
    wrapped = (whole + np.pi) % (2.0 * np.pi) - np.pi
    record = read(log.assign(angle_1=wrapped, speed_1=3.0 * log["speed_1"]))
    np.testing.assert_allclose(np.diff(record.angles, axis=0), np.diff(usual.angles, axis=0), atol=1e-9)
    assert kinds(record) == ["turns"]


def test_rest_that_rounding_hides_is_known_and_its_readings_are_kept() -> None:
    """Of a robot that waits after its motion: changed readings would make the printed error another than a user's."""
    log = clean(12.0)
    rests = (log["time"] > 4.0) & (log["time"] < 8.0)
    for column in log.columns[1:]:
        still = log[column][rests].iloc[0] if "speed" not in column else 0.0
        log.loc[rests, column] = still + 4e-5 * np.random.default_rng(1).standard_normal(int(rests.sum()))
    log["angle_1"], log["angle_2"] = log["angle_1"].round(4), log["angle_2"].round(4)
    log = log[(log["time"] <= 4.0) | rests].drop(columns=["speed_1", "speed_2"])
    record = read(log)
    assert record.rests is not None
    assert record.rests[(record.times > 4.5) & (record.times < 7.5)].all()
    assert not record.rests[record.times < 4.0].any()
    np.testing.assert_array_equal(record.angles, log[["angle_1", "angle_2"]])
    assert kinds(record) == ["rest"]


def test_files_with_some_kinds_of_readings_each_are_one_log(tmp_path: Path) -> None:
    """At the times of the angles; what holds, holds until the next, and files without times are matched by rows."""
    log = clean()
    usual = read(log)
    angles, torques = log[["time", "angle_1", "angle_2"]], log[["time", "torque_1", "torque_2"]]
    often = pd.concat([torques, torques.assign(time=torques["time"] + 0.002, torque_1=9.0)]).sort_values("time")
    (merged,) = every_run(intake(), [angles, often])
    np.testing.assert_array_equal(merged.torques, usual.torques)
    np.testing.assert_array_equal(merged.angles, usual.angles)
    one, other = every_run(intake(), [angles, torques.drop(columns="time"), log])
    np.testing.assert_array_equal(one.torques, other.torques)
    with pytest.raises(RecordError, match="799 rows"):
        every_run(intake(), [angles, torques.drop(columns="time")[:799]])


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


def test_column_that_says_radians_may_turn_many_times() -> None:
    """As that of a motor; one that says no unit may not."""
    log = clean().assign(angle_1=lambda frame: 60.0 * frame["angle_1"], speed_1=lambda frame: 60.0 * frame["speed_1"])
    with pytest.raises(RecordError, match="looks like degrees"):
        read(log)
    said = log.rename(columns={"angle_1": "Angle 1 (rad)", "speed_1": "Speed 1 (rad/sec)"})
    np.testing.assert_allclose(read(said).angles[:, 0], log["angle_1"])
