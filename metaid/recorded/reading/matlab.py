"""Files of MATLAB: arrays and structures by scipy, objects and what MATLAB 7.3 writes by mat-io, an extra.

Simulink's logs are objects by default: a `timeseries` is its data, with times of its own; a table its columns.
"""

from __future__ import annotations

import warnings
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from metaid.errors import RecordError, optional_packages
from metaid.models import Array


def matlab_arrays(path: Path) -> dict[str, Any]:
    """What a file holds, by the names of its variables, structures as dictionaries.  Raises RecordError where it is no
    such file, MissingExtraError where mat-io is missing that it needs.
    """
    from scipy.io import loadmat, matlab  # slow to load

    try:
        with path.open("rb") as file, warnings.catch_warnings(action="ignore"):
            found: dict[str, Any] = loadmat(file, simplify_cells=True)
    except NotImplementedError:
        return _with_objects(path)
    except IndexError:  # of scipy 1.15, where there is no header
        raise RecordError(f"{path}: no file of MATLAB's: Mat file appears to be truncated") from None
    except (matlab.MatReadError, zlib.error, TypeError, KeyError) as problem:
        raise RecordError(f"{path}: no file of MATLAB's: {problem}") from None
    if any(isinstance(each, matlab.MatlabOpaque) for each in found.values()):
        return _with_objects(path)
    return {name: each for name, each in found.items() if not name.startswith("__")}


def _with_objects(path: Path) -> dict[str, Any]:
    with optional_packages("matlab"), warnings.catch_warnings(action="ignore"):  # its import sets an option of pandas
        from matio import load_from_mat
    try:
        with warnings.catch_warnings(action="ignore"):
            read = load_from_mat(str(path))
    except Exception as problem:  # of many kinds, for it checks little
        raise RecordError(
            f"{path}: no file of MATLAB's that can be read: {problem} (allowed: arrays, structures, timeseries, tables)"
        ) from None
    times: list[Array] = []
    found = {name: _plain(each, times) for name, each in read.items()}
    return found if "time" in found or not times else found | {"time": times[0]}


def _plain(value: Any, times: list[Array]) -> Any:
    """A variable without MATLAB's classes; the `times` of a series are added to these."""
    if isinstance(value, pd.DataFrame):
        if isinstance(value.index, pd.TimedeltaIndex):
            times.append(np.asarray(value.index.total_seconds(), dtype=np.float64))
        return {str(name): column.to_numpy() for name, column in value.items()}
    own = _properties(value)
    if "Data_" in own and "TimeInfo" in own:
        times.append(_times_of(own))
        return own["Data_"]
    if own:
        return {name: _plain(each, times) for name, each in own.items()}
    if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
        return {name: _plain(value[name].item(), times) for name in value.dtype.names}
    return value


def _properties(value: Any) -> dict[str, Any]:
    """Those of an object of MATLAB's; none of anything else."""
    own = getattr(value, "properties", None)
    return dict(own) if isinstance(own, Mapping) else {}


def _times_of(series: Mapping[str, Any]) -> Array:
    """The times of a `timeseries` (nrow), which are regular where it holds none."""
    info = _properties(series["TimeInfo"])
    for own in (series.get("Time_"), info.get("Time_")):
        if own is not None and np.size(own):
            return np.ravel(np.asarray(own, dtype=np.float64))
    start, step, count = (float(np.ravel(info[name])[0]) for name in ("Start_", "Increment_", "Length"))
    return np.asarray(start + step * np.arange(round(count)), dtype=np.float64)
