"""What MATLAB and Simulink write beyond plain arrays: objects, and files 7.3."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from metaid.errors import MissingExtraError
from metaid.models import Array
from tests.clean_logs import clean, read

pytest.importorskip("matio")
from matio import save_to_mat
from matio.utils import MatlabOpaque


def arrays_of(log: pd.DataFrame) -> dict[str, Array]:
    """A log as its arrays, two joints wide."""
    kinds = {"q": "angle", "dq": "speed", "tau": "torque"}
    return {own: log[[f"{kind}_1", f"{kind}_2"]].to_numpy() for own, kind in kinds.items()}


def series(data: Array, times: Array | None) -> MatlabOpaque:
    """A `timeseries` as Simulink logs it, regular without times of its own."""
    nothing = np.zeros((0, 0))
    regular = {"Length": np.array([[len(data)]]), "Start_": np.zeros((1, 1)), "Increment_": np.array([[0.005]])}
    info = {"Units": np.array(["seconds"]), "Time_": nothing} | (regular if times is None else {})
    own = {"Data_": data, "Time_": nothing if times is None else times[:, None]}
    return MatlabOpaque(own | {"TimeInfo": MatlabOpaque(info, "tsdata.timemetadata")}, "timeseries")


@pytest.mark.parametrize("version", ["v7", "v7.3"])
@pytest.mark.parametrize("how", ["regular series", "series with times", "one series", "table", "arrays"])
def test_objects_of_matlab_and_files_7_3_are_read_as_tables(how: str, version: str, tmp_path: Path) -> None:
    """Series, tables and arrays, as `save` writes them, with others beside."""
    log, path, columns = clean(), tmp_path / "run.mat", {}
    arrays, times = arrays_of(log), log["time"].to_numpy()
    if how == "one series":
        found = {"simout": series(log.drop(columns="time").to_numpy(), times)}
        columns["simout"] = "angle_1,speed_1,torque_1,angle_2,speed_2,torque_2"
    elif how == "table":
        found = {"log": log}
    elif how == "arrays":
        found = {"run": {"t": times, **arrays}}
    else:
        found = {name: series(each, None if how == "regular series" else times) for name, each in arrays.items()}
    save_to_mat(str(path), found | {"note": "first", "mass": 2.5}, version=version)
    usual, record = read(log), read(str(path), columns=columns)
    np.testing.assert_allclose(record.times, usual.times, atol=1e-12)
    np.testing.assert_array_equal(record.angles, usual.angles)
    np.testing.assert_array_equal(record.speeds, usual.speeds)
    np.testing.assert_array_equal(record.torques, usual.torques)


def test_objects_of_matlab_need_an_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays alone do not."""
    log, path = clean(), tmp_path / "run.mat"
    save_to_mat(str(path), {name: series(each, None) for name, each in arrays_of(log).items()}, version="v7")
    monkeypatch.setitem(sys.modules, "matio", None)
    with pytest.raises(MissingExtraError, match=r"matio is not installed: python -m pip install 'mat-io>="):
        read(str(path))
    savemat(path, {"t": log["time"], **arrays_of(log)})
    np.testing.assert_array_equal(read(str(path)).torques, read(log).torques)
