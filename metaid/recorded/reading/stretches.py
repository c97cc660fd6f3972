"""Stretches of logs that a user leaves out, as where a joint met something."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from metaid.errors import RecordError, unknown
from metaid.recorded.reading.plausible import LEAST_ROWS
from metaid.recorded.reading.readings import LogRun, counted

Stretches = Mapping[str, Sequence[tuple[float, float]]]


def without(stretches: Stretches, *several: Sequence[LogRun]) -> list[tuple[LogRun, ...]]:
    """Several lists of logs without what is left out of those of some names, each stretch from a time to another, in s;
    around the gap that it leaves nothing is fitted or judged.  Raises RecordError where no log has such a name, or a
    stretch has no row, or leaves too few.
    """
    names = dict.fromkeys(record.name for records in several for record in records)
    for name in stretches:
        if name not in names:
            raise RecordError(f"leave-out: {unknown('log', name, names)}")
    return [tuple(_cut(record, stretches.get(record.name, ())) for record in records) for records in several]


def _cut(record: LogRun, stretches: Sequence[tuple[float, float]]) -> LogRun:
    for begin, end in stretches:
        times = record.times
        inside = (times >= begin) & (times <= end)
        count = int(inside.sum())
        if not count or len(times) - count < LEAST_ROWS:
            what = "no row" if not count else "all but a few rows"
            raise RecordError(
                f"leave-out: {record.name} has {what} from {begin:g} to {end:g} s "
                f"(allowed: some of {times[0]:.4g} to {times[-1]:.4g} s)"
            )
        text = f"{counted(count, 'row')} from {begin:g} to {end:g} s left out, as asked"
        record = record.rows(~inside).repaired("without", count, text)
    return record
