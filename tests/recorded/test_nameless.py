"""Logs without names of columns: the user says what these are, or files are called as what is in them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from metaid.errors import RecordError
from metaid.recorded import LogRun, every_run
from tests.clean_logs import clean, intake, kinds, read

BLOCKS = [f"{kind}_{joint}" for kind in ("angle", "speed", "torque") for joint in (1, 2)]
SAID = {"column": "time,angle,speed,-2,torque"}


def in_blocks() -> pd.DataFrame:
    """The clean log as people dump it: angles, speeds, accelerations and torques, one after the other."""
    log = clean()[["time", *BLOCKS]]
    log.insert(5, "acceleration_1", 0.5)
    log.insert(6, "acceleration_2", 0.25)
    return log


def undone(log: pd.DataFrame) -> pd.DataFrame:
    """A log whose speeds are not how fast its angles change."""
    return log.assign(**{name: log[name].to_numpy()[::-1] for name in BLOCKS[2:4]})


def assert_same(record: LogRun, usual: LogRun) -> None:
    np.testing.assert_allclose(record.times, usual.times, atol=1e-12)
    np.testing.assert_allclose(record.angles, usual.angles, atol=1e-12)
    assert record.speeds is not None
    assert usual.speeds is not None
    np.testing.assert_allclose(record.speeds, usual.speeds, atol=1e-12)
    np.testing.assert_allclose(record.torques, usual.torques, atol=1e-12)


WRITTEN: dict[str, Callable[[pd.DataFrame, Path], object]] = {
    "commas": lambda log, path: log.to_csv(path, index=False, header=False),
    "decimal commas": lambda log, path: log.to_csv(path, index=False, header=False, sep=";", decimal=","),
    "blanks": lambda log, path: np.savetxt(path, log),
    "a comment": lambda log, path: np.savetxt(path, log, header="recorded on 3 May\nat 200 Hz", comments="% "),
    "ends of lines": lambda log, path: path.write_text(log.to_csv(index=False, header=False, lineterminator=",\n")),
    "numbers of columns": lambda log, path: log.set_axis(range(9), axis="columns").to_csv(path, index=False),
}


@pytest.mark.parametrize("how", WRITTEN)
def test_user_says_what_columns_without_names_are_in_their_order(how: str, tmp_path: Path) -> None:
    """Whatever is not read among them is passed by."""
    path = tmp_path / "run 7.txt"
    WRITTEN[how](in_blocks(), path)
    assert_same(read(str(path), columns=SAID), read(clean()))


def test_columns_of_one_array_are_said_in_their_order_with_units(tmp_path: Path) -> None:
    log = in_blocks()
    log[["angle_1", "angle_2"]] *= 180.0 / np.pi
    np.savez(tmp_path / "run.npz", data=log.to_numpy())
    record = read(str(tmp_path / "run.npz"), columns={"data": "time,angle:deg,speed,-2,torque"})
    assert_same(record, read(clean()))


def test_rows_without_times_are_as_far_apart_as_the_user_says(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    in_blocks().drop(columns="time").to_csv(path, index=False, header=False)
    record = read(str(path), columns={"column": "angle,speed,-2,torque"}, rate=200.0)
    assert_same(record, read(clean()))
    named = read(clean().drop(columns="time"), rate=200.0)
    assert_same(named, read(clean()))
    allowed = r"\(allowed: --rate for logs without, or whose times count rows\)"
    with pytest.raises(RecordError, match=rf"frame 1: has times, in 'time' {allowed}"):
        read(clean(), rate=200.0)


def test_times_that_count_rows_are_of_the_rate_that_the_user_says() -> None:
    """A row that is lost is missing in its count, too."""
    log = clean().assign(time=np.arange(1600)).drop(index=700)
    record = read(log, rate=200.0)
    np.testing.assert_allclose(record.times, clean().drop(index=700)["time"], atol=1e-12)
    assert [each.text for each in record.repairs] == [
        "time counts rows: 200 of them a second",
        "1 row lost between others: torques hold, and long gaps are not fitted",
    ]


def test_files_are_read_by_what_they_are_called(tmp_path: Path) -> None:
    """Each with a column of each joint, and one with the times."""
    log = clean()
    files = {"dataTimeStamp.txt": ["time"], "dataQ.txt": BLOCKS[:2], "dataDotQ.txt": BLOCKS[2:4], "tau.txt": BLOCKS[4:]}
    for name, columns in files.items():
        np.savetxt(tmp_path / name, log[columns])
    (record,) = every_run(intake(), [str(tmp_path / name) for name in files])
    assert_same(record, read(log))
    assert kinds(record).count("format") == 3
    assert "no names of columns: tau.txt is called as what they are" in [each.text for each in record.repairs]


def in_joints() -> pd.DataFrame:
    """The clean log with all readings of a joint side by side."""
    return clean()[["time", *(f"{kind}_{joint}" for joint in (1, 2) for kind in ("angle", "speed", "torque"))]]


def with_accelerations() -> pd.DataFrame:
    """As they are differentiated: noisy, and a little late."""
    log, random = in_blocks(), np.random.default_rng(0)
    for joint in (1, 2):
        exact = np.gradient(log[f"speed_{joint}"], log["time"])
        log[f"acceleration_{joint}"] = np.roll(exact, 2) + 0.1 * np.ptp(exact) * random.standard_normal(len(log))
    return log


def in_milliseconds() -> pd.DataFrame:
    log = in_blocks()
    return log.assign(time=1e3 * log["time"])


RECOGNISED: dict[str, Callable[[], pd.DataFrame]] = {
    "time, angle, speed, nothing, torque of all joints": in_blocks,
    "time, angle, speed, torque of joint after joint": in_joints,
    "time, angle, speed, nothing, torque of all joints,": with_accelerations,
    "time, angle, speed, nothing, torque of": in_milliseconds,
    "angle, speed, nothing, torque of all joints, by how they change at 200 Hz": lambda: in_blocks().drop(
        columns="time"
    ),
    "torque, speed, angle of all joints, by how they change at 200 Hz": lambda: in_blocks()[BLOCKS[::-1]],
}


@pytest.mark.parametrize("said", RECOGNISED)
def test_columns_without_names_are_known_by_how_they_change(said: str, tmp_path: Path) -> None:
    """Speeds are how fast angles change, accelerations how fast speeds do, and torques are what is left; rows without
    times have the rate by which speeds are that.
    """
    np.savetxt(tmp_path / "run.txt", RECOGNISED[said]())
    record = read(str(tmp_path / "run.txt"))
    joints = slice(None, None, -1 if said.startswith("torque") else 1)
    assert_same(record.mapped(lambda kind: kind[:, joints]), read(clean()))
    assert any(f"no names of columns: taken as {said}" in each.text for each in record.repairs)


def test_rows_without_readings_do_not_hide_how_columns_change(tmp_path: Path) -> None:
    """As a recorder writes them that had none yet."""
    log = in_joints()
    log.iloc[0, 1:] = 1e300
    np.savetxt(tmp_path / "run.txt", log)
    np.testing.assert_allclose(read(str(tmp_path / "run.txt")).angles, read(clean()).angles[1:], atol=1e-12)


def test_columns_of_one_joint_without_names_are_known(tmp_path: Path) -> None:
    columns = ["time", "angle_1", "speed_1", "torque_1"]
    np.savetxt(tmp_path / "run.txt", clean()[columns])
    record = read(str(tmp_path / "run.txt"), joints=("1",))
    assert_same(record, read(clean()[columns], joints=("1",)))


FREE: dict[str, list[str]] = {
    "time, angle, speed of all joints": ["time", *BLOCKS[:4]],
    "angle, speed of all joints, by how they change at 200 Hz": BLOCKS[:4],
    "time, angle of all joints": ["time", *BLOCKS[:2]],
}


@pytest.mark.parametrize("said", FREE)
def test_columns_of_a_pendulum_that_swings_freely_need_no_torques(said: str, tmp_path: Path) -> None:
    """Of any other robot the user is asked."""
    columns = FREE[said]
    np.savetxt(tmp_path / "run.txt", clean()[columns])
    record = read(str(tmp_path / "run.txt"), may_swing=True)
    usual = clean()
    np.testing.assert_allclose(record.angles, usual[BLOCKS[:2]], atol=1e-12)
    np.testing.assert_allclose(record.times, usual["time"], atol=1e-12)
    assert not record.torques.any()
    assert any(f"no names of columns: taken as {said}" in each.text for each in record.repairs)
    with pytest.raises(RecordError, match="no names of its"):
        read(str(tmp_path / "run.txt"))
    (tmp_path / "run.txt").rename(tmp_path / "摆.txt")
    np.testing.assert_array_equal(read(str(tmp_path / "摆.txt"), may_swing=True).angles, record.angles)


def test_columns_of_a_file_that_is_called_as_torques_are_no_angles(tmp_path: Path) -> None:
    """Though a pendulum may have none."""
    np.savetxt(tmp_path / "tau.txt", clean()[["time", *BLOCKS[4:]]])
    with pytest.raises(RecordError, match="no names of its 3 columns"):
        read(str(tmp_path / "tau.txt"), may_swing=True)


def test_column_without_a_name_may_be_the_angle_of_a_pendulum(tmp_path: Path) -> None:
    """Nothing but the user says how often it was read."""
    np.savetxt(tmp_path / "run.txt", clean()["angle_1"])
    given = {"joints": ("1",), "may_swing": True}
    with pytest.raises(RecordError, match=r"--map column=angle and --rate HZ\)"):
        read(str(tmp_path / "run.txt"), **given)
    record = read(str(tmp_path / "run.txt"), columns={"column": "angle"}, rate=200.0, **given)
    np.testing.assert_allclose(record.angles[:, 0], clean()["angle_1"], atol=1e-12)


def test_angles_of_a_table_without_names_are_said_to_be_in_degrees(tmp_path: Path) -> None:
    """Once its columns are known; the message of the refusal says how."""
    log = in_joints()
    log[["angle_1", "angle_2", "speed_1", "speed_2"]] *= 180.0 / np.pi
    np.savetxt(tmp_path / "run.txt", log)
    record = read(str(tmp_path / "run.txt"), columns={"angle": "angle:deg", "speed": "speed:deg/s"})
    assert_same(record, read(clean()))


@pytest.mark.parametrize("ending", [".npy", ".npz", ".mat", ".json"])
def test_array_that_holds_all_is_known_by_how_its_columns_change(ending: str, tmp_path: Path) -> None:
    """Whatever it is called."""
    path, array = tmp_path / f"run{ending}", in_blocks().to_numpy()
    if ending == ".npy":
        np.save(path, array)
    elif ending == ".npz":
        np.savez(path, array)
    elif ending == ".mat":
        savemat(path, {"data": array})
    else:
        path.write_text(json.dumps({"rows": array.tolist()}))
    assert_same(read(str(path)), read(clean()))
    if ending == ".npy":
        np.save(path, undone(in_blocks()).to_numpy())
        with pytest.raises(RecordError, match=r"no names of its 9 columns .* --map run=time,angle,speed,-2,torque\)"):
            read(str(path))


def test_frame_whose_columns_only_count_has_no_names_of_columns() -> None:
    assert_same(read(pd.DataFrame(in_blocks().to_numpy())), read(clean()))
    with pytest.raises(RecordError, match=r"frame 1: no names of its 9 columns"):
        read(pd.DataFrame(undone(in_blocks()).to_numpy()))


def test_arrays_of_one_kind_each_are_read_by_what_files_are_called(tmp_path: Path) -> None:
    log = clean()
    for name, columns in {"t": ["time"], "q": BLOCKS[:2], "dq": BLOCKS[2:4], "tau": BLOCKS[4:]}.items():
        np.save(tmp_path / f"{name}.npy", log[columns].to_numpy())
    (record,) = every_run(intake(), [str(tmp_path / f"{name}.npy") for name in ("t", "q", "dq", "tau")])
    assert_same(record, read(log))
    (tmp_path / "t.npy").write_bytes(b"no array")
    with pytest.raises(RecordError, match=r"t\.npy: no file of a NumPy array"):
        read(str(tmp_path / "t.npy"))


def test_columns_that_may_be_several_things_are_left_to_the_user(tmp_path: Path) -> None:
    """As two kinds of torques, or wished angles beside those measured."""
    for number, more in enumerate((BLOCKS[4:], BLOCKS[:2])):
        log = pd.concat([in_blocks()[["time", *BLOCKS]], 1.01 * clean()[more]], axis="columns")
        np.savetxt(tmp_path / f"run{number}.txt", log)
        with pytest.raises(RecordError, match="no names of its 9 columns"):
            read(str(tmp_path / f"run{number}.txt"))


@pytest.mark.parametrize(
    ("dropped", "usual"),
    [
        ((), "time,angle,speed,-2,torque"),
        (("acceleration_1", "acceleration_2"), "time,angle,speed,torque"),
        (("time", "acceleration_1", "acceleration_2"), "angle,speed,torque and --rate HZ"),
    ],
)
def test_refusal_says_what_columns_usually_are(dropped: tuple[str, ...], usual: str, tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    log = undone(in_blocks().drop(columns=list(dropped)))
    np.savetxt(path, log)
    with pytest.raises(RecordError) as refused:
        read(str(path))
    assert str(refused.value) == (
        f"{path}: no names of its {log.shape[1]} columns (allowed: a first line time, angle_1, torque_1, …; or what "
        f"they are in their order, as --map column={usual})"
    )


def test_three_columns_of_one_joint_are_likelier_to_have_a_time_than_a_speed(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "run.txt", clean()[["time", "angle_1", "torque_1"]])
    with pytest.raises(RecordError, match=r"--map column=time,angle,torque\)"):
        read(str(tmp_path / "run.txt"), joints=("1",))


@pytest.mark.parametrize(
    ("said", "match"),
    [
        ({"column": "time,angle,torque"}, r"time,angle,torque are 5 columns \(allowed: all 9, in their order; -2 "),
        ({"column": "time,angle,tork"}, "unknown meaning 'tork'; did you mean 'torque'"),
        ({"colum": "time,angle"}, "unknown word 'colum'; did you mean 'column'"),
        ({"column": "time,angle:furlong,speed,-2,torque"}, "unknown unit 'furlong'"),
    ],
)
def test_order_that_columns_cannot_have_is_refused(said: dict[str, str], match: str, tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    np.savetxt(path, in_blocks())
    with pytest.raises(RecordError, match=match):
        read(str(path), columns=said)
