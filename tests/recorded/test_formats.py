"""Logs are read alike, whatever they are written in, in one file or in several."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from metaid.errors import MissingExtraError, RecordError
from metaid.recorded import every_run
from tests.clean_logs import clean, intake, kinds, read

WRITTEN: dict[str, Callable[[pd.DataFrame, Path], object]] = {
    "semicolons": lambda log, path: log.to_csv(path, index=False, sep=";", decimal=","),
    "byte order mark": lambda log, path: log.to_csv(path, index=False, encoding="utf-8-sig"),
    "tabs": lambda log, path: log.to_csv(path, index=False, sep="\t"),
    "blanks": lambda log, path: np.savetxt(path, log, header=" ".join(log.columns)),
    "UTF-16": lambda log, path: log.to_csv(path, index=False, sep="\t", encoding="utf-16"),
    "a title": lambda log, path: path.write_text("Log of 3 May\n\n" + log.to_csv(index=False)),
    "ends of lines": lambda log, path: path.write_text(
        "Friday, 3 May\t12:07\tControl\n\n"
        + "\t".join(log.columns)
        + "\n"
        + log.to_csv(index=False, header=False, sep="\t", lineterminator="\t\n")
    ),
    "an index": lambda log, path: log.to_csv(path),
    "quotes": lambda log, path: log.to_csv(path, index=False, quoting=1),
}


@pytest.mark.parametrize("how", WRITTEN)
def test_text_is_read_as_it_is_written(how: str, tmp_path: Path) -> None:
    """Whatever separates columns or ends lines, with decimal commas, a byte order mark, and a title above."""
    path = tmp_path / ("log.dat" if how == "blanks" else "log.csv")
    WRITTEN[how](clean(), path)
    record = read(str(path))
    usual = read(clean())
    np.testing.assert_allclose(record.angles, usual.angles, atol=1e-12)
    np.testing.assert_allclose(record.torques, usual.torques, atol=1e-12)
    separated = ("semicolons", "tabs", "blanks", "UTF-16", "ends of lines")
    assert kinds(record) == (["format"] if how in separated else [])


def arrays_of(log: pd.DataFrame) -> dict[str, np.ndarray]:
    """A log as its arrays, two joints wide."""
    return {
        own: log[[f"{kind}_1", f"{kind}_2"]].to_numpy()
        for own, kind in (("q", "angle"), ("dq", "speed"), ("tau", "torque"))
    }


def test_columns_of_a_frame_that_are_twice_are_read_once() -> None:
    """As where parts have been put side by side, each with its time, and an index beside a column of its name; with
    other cells they are refused.
    """
    log = clean()
    usual, times = read(log), log["time"]
    for frame in (pd.concat([log, times], axis="columns"), log.set_index(times.rename("time"))):
        np.testing.assert_array_equal(read(frame).torques, usual.torques)
    with pytest.raises(RecordError, match=r"frame 1: several columns are called 'time' \(allowed: one of each name\)"):
        read(pd.concat([log, times + 1.0], axis="columns"))


@pytest.mark.parametrize("how", ["frame", "parquet", "csv"])
def test_lists_in_cells_are_columns_of_joints(how: str, tmp_path: Path) -> None:
    """By the names that messages have beside them, though the first holds no angles."""
    log, path, names = clean(), tmp_path / f"run.{how}", ["elbow", "hand"]
    cells = {own: [*map(list, array.tolist())] for own, array in arrays_of(log).items()}
    frame = pd.DataFrame({"stamp": log["time"], "name": [names] * len(log), **cells})
    frame.loc[0, "q"] = None
    if how == "csv":
        frame["tau"] = [[*map(np.float64, each)] for each in frame["tau"]]
    write = {"csv": lambda: frame.to_csv(path, index=False), "parquet": lambda: frame.to_parquet(path)}
    write.get(how, lambda: None)()
    record = read(frame if how == "frame" else str(path), joints=("elbow", "hand"))
    for name in ("angles", "speeds", "torques"):
        np.testing.assert_array_equal(getattr(record, name), getattr(read(log), name)[1:])


@pytest.mark.parametrize("ending", ["mat", "npz", "json"])
def test_matrix_is_read_by_the_names_of_its_columns(ending: str, tmp_path: Path) -> None:
    """Which stand beside it as words, as those of a frame that pandas has split."""
    log, path = clean(), tmp_path / f"run.{ending}"
    if ending == "json":
        log.to_json(path, orient="split", double_precision=15)
    elif ending == "mat":
        savemat(path, {"column_name": np.array([*log.columns], dtype=object), "data": log.to_numpy()})
    else:
        np.savez(path, names=np.array([*log.columns]), data=log.to_numpy().T)
    np.testing.assert_allclose(read(str(path)).torques, read(log).torques, rtol=1e-12)


@pytest.mark.parametrize("how", ["step", "structure", "lying", "lists", "records", "lines", "groups", "fields"])
def test_arrays_are_read_as_tables(how: str, tmp_path: Path) -> None:
    """Of NumPy with the step alone, of MATLAB in a structure, or with a column a time, of JSON in lists or in records,
    of HDF5 in groups beside pictures, or in one table of fields; no numbers are passed by.
    """
    endings = {"step": "npz", "lists": "json", "records": "json", "lines": "jsonl", "groups": "hdf5", "fields": "h5"}
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
    elif how == "groups":
        with h5py.File(path, "w") as file:
            file.attrs["dt"], file["task"] = 0.005, "lift"
            file["observations/images/top"] = np.zeros((len(log), 2, 2, 3), np.uint8)
            for name, each in arrays.items():
                file[f"observations/{name}"] = each
    elif how == "fields":
        kinds = [("t", float), *((name, float, 2) for name in arrays)]
        table = [(time, *row) for time, *row in zip(times, *arrays.values(), strict=True)]
        with h5py.File(path, "w") as file:
            file["log"] = np.array(table, dtype=kinds)
    elif how == "structure":
        savemat(path, {"run": {"t": times, "note": "first", **arrays}})
    else:
        savemat(path, {"time": times[None], "Ts": 1.0} | {name: each.T for name, each in arrays.items()})
    usual, record = read(log), read(str(path))
    np.testing.assert_allclose(record.times, usual.times, atol=1e-12)
    np.testing.assert_array_equal(record.angles, usual.angles)
    np.testing.assert_array_equal(record.speeds, usual.speeds)
    np.testing.assert_array_equal(record.torques, usual.torques)


def test_hdf5_needs_an_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MissingExtraError, match=r"h5py is not installed: python -m pip install 'h5py>="):
        read(str(tmp_path / "run.h5"))


def test_comments_above_a_table_may_be_many_and_look_like_names(tmp_path: Path) -> None:
    """As units of columns, a line each."""
    log, path = clean(), tmp_path / "run.csv"
    units = "\n".join(f"# {column}: {unit}" for column in log.columns for unit in ("rad", "s", "N m", "m", "rad/s"))
    path.write_text(f"# Recorded with\n#\n{units}\n#\n{log.to_csv(index=False)}")
    assert len(units.splitlines()) > 30
    plain = tmp_path / "plain.csv"
    log.to_csv(plain, index=False)
    np.testing.assert_array_equal(read(str(path)).angles, read(str(plain)).angles)


def test_what_a_serial_port_said_is_a_table(tmp_path: Path) -> None:
    """Though its names stand twice, once in a comment, and lines of other kinds above it and below."""
    log, path = clean(), tmp_path / "swing.log"
    text = log.to_csv(index=False)
    title = f"{'# idle,angle_1,0.62' + chr(10)}" * 20 + f"  STAGE 1: RELEASE.\n# columns: {','.join(log.columns)}\n"
    path.write_text(f"{title}{text}# END\n# idle,angle_1,0.53\n")
    record = read(str(path))
    np.testing.assert_array_equal(record.angles, read(log).angles)
    assert [repair.text for repair in record.repairs] == ["2 rows without a number left out, the first row 1601: time"]


def test_names_in_a_comment_are_those_of_columns_though_units_stand_below(tmp_path: Path) -> None:
    log, path = clean(), tmp_path / "run.csv"
    units = ",".join("s" if name == "time" else "rad" for name in log.columns)
    path.write_text(f"# {','.join(log.columns)}\n{units}\n{log.to_csv(index=False, header=False)}")
    np.testing.assert_array_equal(read(str(path)).angles, read(log).angles)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("run.npz", b"hello", "no file of NumPy's arrays: File is not a zip file"),
        ("run.mat", b"hello", "no file of MATLAB's: Mat file appears to be truncated"),
        ("run.mat", b"MATLAB 7.3".ljust(124) + b"\x00\x02IM".ljust(400), "no file of MATLAB's that can be read: "),
        ("run.json", b"{", "no JSON: Expecting property name"),
        ("run.h5", b"hello", "not a file of that format (allowed: the path of a log)"),
        ("run.h5", None, "No such file or directory (allowed: the path of a log)"),
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
