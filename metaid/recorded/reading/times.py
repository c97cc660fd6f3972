"""The times of a log: their unit, their order, and where they part it into runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.errors import RecordError
from metaid.models import Array
from metaid.recorded.reading.plausible import LEAST_ROWS
from metaid.recorded.reading.readings import LogRun, counted

CLOCKS = ("time", "t", "timestamp", "stamp", "times", "timestamps", "clock", "elapsed", "epoch")
UNITS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}
SPELLED = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec", "msecs", "milliseconds", "millis"), "ms"),
    **dict.fromkeys(("us", "µs", "usec", "usecs", "microseconds", "micros"), "µs"),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds", "nanos"), "ns"),
}
FASTEST, SLOWEST = 1e-4, 0.1  # s between two rows of a log of a robot: 10 kHz to 10 Hz
NEARLY = 1.05  # of these: clocks are not exact
NO_TIME = 1e20  # in any unit: what no clock says
AGAIN = 1.0  # s: a time that falls back by more begins another run
GAP = 0.5  # s between two rows: nobody knows what happened there
RARELY = 20.0  # periods of a log that is read so rarely
SHORT = 1.0  # s: what is shorter is no run of its own


def numeric_times(columns: Sequence[pd.Series]) -> Array:
    """Times from that of the first row on (nrow), NaN where a cell has none: in the unit of the column, ns of dates
    and of columns of s and ns.

    Whole numbers are subtracted before they are rounded: those of ns since 1970 have 19 digits.
    """
    if len(columns) == 2:
        seconds, rest = (numeric_times([column]) for column in columns)
        return 1e9 * seconds + rest
    cells = columns[0]
    if not pd.api.types.is_numeric_dtype(cells):
        numbers = None if pd.api.types.is_datetime64_any_dtype(cells) else pd.to_numeric(cells, errors="coerce")
        if numbers is None or numbers.isna().mean() > 0.5:
            dates = pd.to_datetime(cells, errors="coerce", utc=True, format="ISO8601").dt.as_unit("ns")
            first = dates.dropna()
            return np.asarray((dates - first.iloc[0]).dt.total_seconds() * 1e9 if len(first) else dates.isna() * np.nan)
        cells = numbers
    if len(cells) and pd.api.types.is_integer_dtype(cells):
        cells = cells - cells.iloc[0]
    times = np.asarray(cells.to_numpy(dtype=np.float64, na_value=np.nan), dtype=np.float64)
    return np.where(np.abs(times) < NO_TIME, times, np.nan)


def counts_rows(times: Array) -> bool:
    """Whether times (nrow) are the numbers of rows: whole, and usually one more than in the row above."""
    finite = times[np.isfinite(times)]
    return len(finite) > 1 and bool((finite == np.round(finite)).all() and np.median(np.diff(finite)) == 1.0)


def in_seconds(readings: LogRun, said: str | None) -> LogRun:
    """The same with times in s from its first row on. Their usual step tells the unit, for a log of a robot has 10 Hz
    to 10 kHz; between two that are possible the speeds tell. What the column's name has `said` is taken where it is
    possible.  Raises RecordError where the unit is none of s, ms, µs, ns.
    """
    step = _usual_step(readings)
    possible = [unit for unit, size in UNITS.items() if FASTEST / NEARLY <= step * size <= SLOWEST * NEARLY]
    if not possible:
        raise RecordError(
            f"{readings.name}: the usual step between times is {step:.4g}, which in s, ms, µs or ns is no rate of "
            "10 Hz to 10 kHz (allowed: times in one of these)"
        )
    unit = said if said in possible else possible[0]
    if said not in possible and len(possible) > 1 and readings.speeds is not None:
        unit = min(possible, key=lambda each: _disagreement(readings, UNITS[each]))
    timed = replace(readings, times=UNITS[unit] * (readings.times - readings.times[np.isfinite(readings.times)].min()))
    if unit == "s":
        return timed
    rate = 1.0 / (step * UNITS[unit])
    return timed.repaired("unit of times", len(readings), f"times are in {unit}: the log has {rate:.4g} Hz")


def _usual_step(readings: LogRun) -> float:
    finite = readings.times[np.isfinite(readings.times)]
    steps = np.diff(np.sort(finite))
    steps = steps[steps > 0.0]
    if not len(steps):
        raise RecordError(f"{readings.name}: the times of all rows are the same")
    return float(np.median(steps))


def _disagreement(readings: LogRun, size: float) -> float:
    """How far speeds are from the change of the angles, were the unit of times so many s, as a logarithm."""
    assert readings.speeds is not None
    steps = size * np.diff(readings.times)
    said = np.abs(0.5 * (readings.speeds[1:] + readings.speeds[:-1]) * steps[:, None])
    seen = np.abs(np.diff(readings.angles, axis=0))
    whole = float(np.nansum(seen))
    return abs(float(np.log(max(float(np.nansum(said)), 1e-300) / max(whole, 1e-300))))


def in_order(readings: LogRun) -> LogRun:
    """The same with times that do not fall: sorted, and without rows that are there twice."""
    back = int((np.diff(readings.times) < 0.0).sum())
    if back:
        readings = readings.rows(np.argsort(readings.times, kind="stable"))
        readings = readings.repaired("order", back, f"{counted(back, 'time')} before the row above: rows are sorted")
    same = np.diff(readings.times) == 0.0
    for read in readings.kinds.values():
        same &= (read[1:] == read[:-1]).all(axis=1)
    return _without(readings, same, "that are there twice")


def rising(readings: LogRun) -> LogRun:
    """The same with times that rise: of rows that are at the same time the first alone."""
    return _without(readings, np.diff(readings.times) <= 0.0, "at the time of the row above")


def _without(readings: LogRun, late: NDArray[np.bool_], which: str) -> LogRun:
    """The same without rows after the first (nrow − 1)."""
    count = int(late.sum())
    if not count:
        return readings
    kept = readings.rows(np.concatenate([[True], ~late]))
    return kept.repaired("repeated times", count, f"{counted(count, 'row')} {which}: left out")


def begins_again(readings: LogRun) -> list[LogRun]:
    """The parts of a log whose clock was set back, each a run."""
    parts = _parts(readings, np.diff(readings.times) < -AGAIN)
    # rows in disorder fall back often, and by as much as they went ahead
    return parts if min(map(len, parts)) >= LEAST_ROWS else [readings]


def _parts(readings: LogRun, ends: NDArray[np.bool_]) -> list[LogRun]:
    """The parts of a log, of which one ends at each of some of its rows but the last (nrow − 1)."""
    begins = [0, *(np.flatnonzero(ends) + 1).tolist(), len(readings)]
    return [readings.rows(slice(begin, end)) for begin, end in pairwise(begins)]


def runs_of(readings: LogRun) -> list[LogRun]:
    """The runs between the gaps of a log, the first of which says what was repaired."""
    gap = max(GAP, RARELY * readings.period)
    steps = np.diff(readings.times)
    gaps = steps[steps > gap]
    parts = _parts(readings, steps > gap)
    runs = [part for part in parts if len(part) >= LEAST_ROWS and part.times[-1] - part.times[0] >= SHORT]
    if not len(gaps) or not runs:
        return [readings]
    between = f"{gaps.min():.3g} s" if len(gaps) == 1 else f"{gaps.min():.3g} to {gaps.max():.3g} s"
    what = f"{counted(len(gaps), 'gap')} of {between}: cut there into {counted(len(runs), 'run')}"
    lost = len(readings) - sum(map(len, runs))
    if lost:
        what += f", {counted(lost, 'row')} between gaps left out"
    runs[0] = runs[0].repaired("gaps", len(gaps), what)
    said = (runs[0].repairs[-1],)
    return [
        replace(run, times=run.times - run.times[0], repairs=run.repairs if run is runs[0] else said) for run in runs
    ]
