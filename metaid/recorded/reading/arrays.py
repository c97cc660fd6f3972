"""Files of arrays, of NumPy (`.npz`, `.npy`), MATLAB (`.mat`), HDF5 or JSON, as frames: a row a time, a column a joint.

An array that has a row for each time is as many columns as it has, `q` is `q_1`, `q_2` and so on; one that lies is
turned. One alone of its width may have its columns' names beside it, in an array of as many words. Where no array holds
the times, a number that is called as a step or a rate makes them. JSON may have records, one a time, too.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.errors import RecordError, first_of
from metaid.recorded.reading.hdf5 import hdf5_arrays
from metaid.recorded.reading.matlab import matlab_arrays
from metaid.recorded.reading.times import CLOCKS

HDF5 = (".h5", ".hdf5")
ARRAYS = (".npz", ".npy", ".mat", *HDF5, ".json", ".jsonl")
STEPS, RATES = ("dt", "ts", "period"), ("fs", "rate")
FEWEST = 10  # numbers in the longer direction of an array that may be a table
MOST_NAMED = 8

Named = dict[str, NDArray[Any]]


def arrays_frame(path: Path) -> pd.DataFrame:
    """The frame that a file of arrays makes.  Raises RecordError where none has a row for each time."""
    known = {".npz": _numpy, ".npy": _alone, ".mat": matlab_arrays, **dict.fromkeys(HDF5, hdf5_arrays)}
    read = known.get(path.suffix, _json)
    leaves = list(_leaves(_unwrapped(read(path))))
    every = {name: each for name, each in leaves if np.isrealobj(each) and np.issubdtype(each.dtype, np.number)}
    tables = {name: np.atleast_2d(np.squeeze(each)) for name, each in every.items()}
    tables = {name: table for name, table in tables.items() if table.ndim == 2 and max(table.shape) >= FEWEST}
    if not tables:
        names = first_of(list(every), MOST_NAMED) if every else "none"
        raise RecordError(f"{path}: no array has a row for each time, among {names} (allowed: arrays as t, q, tau)")
    times = [table.size for name, table in tables.items() if _last_word(name) in CLOCKS and 1 in table.shape]
    count = times[0] if times else Counter(max(table.shape) for table in tables.values()).most_common(1)[0][0]
    tables = {name: table if table.shape[0] == count else table.T for name, table in tables.items()}
    widths = Counter(table.shape[1] for table in tables.values() if len(table) == count)
    said = {len(words): words for words in _words(leaves) if widths[len(words)] == 1 < len(words)}
    columns: Named = {}
    for name, table in tables.items():
        if len(table) == count:
            width = table.shape[1]
            called = [name] if width == 1 else said.get(width, [f"{name}_{number + 1}" for number in range(width)])
            columns |= dict(zip(called, table.T, strict=True))
    step = None if times else next(_steps(every), None)
    if step is not None:
        columns["time"] = step * np.arange(count)
    return pd.DataFrame(columns)


def _unwrapped(found: dict[str, Any]) -> dict[str, Any]:
    """What the one structure holds, without its name, where beside it are none but single numbers and words."""
    inside = {name: each for name, each in found.items() if isinstance(each, dict)}
    beside = {name: each for name, each in found.items() if name not in inside}
    if len(inside) != 1 or any(np.size(each) >= FEWEST for each in beside.values()):
        return found
    return _unwrapped(beside | next(iter(inside.values())))


def _numpy(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}
    try:
        with zipfile.ZipFile(path), np.load(path, allow_pickle=False) as archive:
            for name in archive.files:
                with suppress(ValueError):  # of objects, which are no numbers
                    found[name] = archive[name]
            return found
    except (zipfile.BadZipFile, zlib.error, EOFError) as problem:
        raise RecordError(f"{path}: no file of NumPy's arrays: {problem}") from None


def _alone(path: Path) -> dict[str, Any]:
    """The array in a file of one, by the name of the file."""
    try:
        return {path.stem: np.load(path, allow_pickle=False)}
    except (ValueError, EOFError) as problem:
        raise RecordError(f"{path}: no file of a NumPy array: {problem}") from None


def _json(path: Path) -> dict[str, Any]:
    text = path.read_text(encoding="utf-8")
    lines = text.strip().splitlines() if path.suffix == ".jsonl" else [text]
    try:
        found = [json.loads(line) for line in lines]
    except json.JSONDecodeError as problem:
        raise RecordError(f"{path}: no JSON: {problem}") from None
    return _by_name(found if path.suffix == ".jsonl" else found[0])


def _by_name(found: Any) -> dict[str, Any]:
    """The arrays in what was read of JSON, those of records by the names that these have."""
    if isinstance(found, list):
        records = [each for each in found if isinstance(each, dict)]
        names = dict.fromkeys(name for each in records for name in each)
        return _by_name({name: [each.get(name) for each in records] for name in names})
    arrays: dict[str, Any] = {}
    for name, value in found.items() if isinstance(found, dict) else ():
        if isinstance(value, dict):
            arrays[name] = _by_name(value)
        elif isinstance(value, list) and any(isinstance(each, dict) for each in value):
            arrays |= _by_name(value)
        elif isinstance(value, list) and all(isinstance(each, str) for each in value):
            arrays[name] = np.asarray(value, dtype=np.str_)
        else:
            with suppress(ValueError, TypeError):  # of words, or of rows that are not as long
                arrays[name] = np.asarray(value, dtype=np.float64)
    return arrays


def _leaves(values: dict[str, Any], within: str = "") -> Iterator[tuple[str, NDArray[Any]]]:
    """Arrays, those in structures by the names of both."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{within}{name}_")
        else:
            yield f"{within}{name}", np.asarray(value)


def _words(leaves: Iterable[tuple[str, NDArray[Any]]]) -> Iterator[list[str]]:
    """Arrays of words that differ."""
    for _, value in leaves:
        words = np.ravel(value).tolist()
        if all(isinstance(each, str) for each in words) and len(set(words)) == len(words):
            yield words


def _steps(every: Named) -> Iterator[float]:
    """The steps between two rows, in s, that numbers are called."""
    for name, each in every.items():
        if each.size == 1 and (number := float(each.flat[0])) > 0.0:
            if _last_word(name) in STEPS:
                yield number
            if _last_word(name) in RATES:
                yield 1.0 / number


def _last_word(name: str) -> str:
    return name.lower().rpartition("_")[2]
