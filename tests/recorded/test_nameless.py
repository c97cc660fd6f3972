"""Logs without names of columns: the user says what these are, or files are called as what is in them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

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
    with pytest.raises(RecordError, match=r"frame 1: has times, in 'time' \(allowed: --rate for logs without\)"):
        read(clean(), rate=200.0)


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
    log = in_blocks().drop(columns=list(dropped))
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
