"""One log out of several tables, each with some kinds of readings: files of a folder, or topics of a bag.

All is taken at the times of the angles: a torque holds until the next, speeds are straight between two. Tables without
times are matched row by row.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from metaid.errors import RecordError
from metaid.models import Array
from metaid.recorded.reading.columns import Understood
from metaid.recorded.reading.formats import Table
from metaid.recorded.reading.mapping import KINDS
from metaid.recorded.reading.readings import Repair, counted, straight
from metaid.recorded.reading.times import numeric_times


def lacking(pieces: Sequence[Understood], needs_torques: bool) -> str | None:
    """The first kind of readings, or `time`, that no table has; None where all that is needed is there."""
    if not any(piece.times for piece in pieces):
        return "time"
    needed = ("angle", "torque") if needs_torques else ("angle",)
    return next((kind for kind in needed if not any(piece.kinds[kind] for piece in pieces)), None)


def merged(pieces: Sequence[Understood]) -> Understood:
    """The table that several make.  Raises RecordError where their times have nothing in common."""
    owners = {kind: piece for kind in KINDS for piece in reversed(pieces) if piece.kinds[kind]}
    base, used = owners["angle"], list(dict.fromkeys(owners.values()))
    frames = {piece: piece.load() for piece in pieces}
    clock = next(piece for piece in (base, *pieces) if piece.times)
    rows, named = len(frames[base]), base.table.name
    if clock is not base and len(frames[clock]) != rows:
        raise RecordError(
            f"{named}: no times, and {rows:,} rows where {clock.table.name} has others (allowed: as many)"
        )
    timed = [clock, *(piece for piece in used if piece.times and piece is not clock)]
    clocks = [[frames[piece][name] for name in piece.times] for piece in timed]
    times = dict(zip(timed, _times(clocks), strict=True))
    found: dict[str, Array | pd.Series] = {"time": times[clock]}
    for kind, piece in owners.items():
        read = frames[piece][[each for each in piece.kinds[kind] if each]]
        if piece in times and piece is not clock:
            numbers = read.apply(pd.to_numeric, errors="coerce").to_numpy(dtype=np.float64)
            sampled = sampled_at(times[clock], times[piece], numbers, kind == "torque")
            found |= dict(zip(read.columns, sampled.T, strict=True))
        elif len(read) == rows:
            found |= {str(name): read[name].reset_index(drop=True) for name in read.columns}
        else:
            raise RecordError(f"{piece.table.name}: no times, and {len(read):,} rows (allowed: {rows:,}, as {named})")
    frame = pd.DataFrame(found)
    if frame.isna().any(axis=1).all():
        raise RecordError(f"{named}: no time in common with {', '.join(piece.table.name for piece in used[1:])}")
    kinds = {kind: owners[kind].kinds[kind] if kind in owners else () for kind in KINDS}
    notes = tuple(note for piece in used for note in piece.notes)
    notes += (Repair("merged", len(used), f"one log of {counted(len(used), 'table')}, at the times of the angles"),)
    name = " + ".join(dict.fromkeys(Path(piece.table.name).name for piece in used))
    table = Table(name, tuple(frame.columns), lambda wanted: frame[list(wanted)])
    factors = {column: factor for piece in used for column, factor in piece.factors.items()}
    radians = frozenset().union(*(piece.radians for piece in used))
    return Understood(table, ("time",), clock.unit, kinds, notes, factors, radians=radians)


def _times(columns: Sequence[Sequence[pd.Series]]) -> list[Array]:
    """The times of several tables (nrow each), from one beginning."""
    if len({len(own) for own in columns}) > 1:
        raise RecordError("tables with times in s and ns, and others (allowed: all of one kind)")
    together = [pd.concat(parts, ignore_index=True) for parts in zip(*columns, strict=True)]
    edges = np.cumsum([len(own[0]) for own in columns])[:-1]
    return np.split(numeric_times(together), edges)


def sampled_at(times: Array, own: Array, read: Array, holds: bool) -> Array:
    """Readings at other times (nrow x ncolumn), NaN where there were none.

    Args:
        times: the other times (nrow).
        own: those of the readings (nown).
        read: the readings (nown x ncolumn).
        holds: whether each holds until the next; else they are straight between two.
    """
    known = np.isfinite(own) & np.isfinite(read).all(axis=1)
    own, read = own[known], read[known]
    if not len(own):
        return np.full((len(times), read.shape[1]), np.nan)
    order = np.argsort(own, kind="stable")
    own, read = own[order], read[order]
    inside = (times >= own[0]) & (times <= own[-1] + (own[-1] - own[0]) / max(len(own) - 1, 1))
    if holds:
        sampled = read[np.maximum(np.searchsorted(own, times, side="right") - 1, 0)]
    else:
        sampled = straight(times, own, read)
    return np.where(inside[:, None], sampled, np.nan)
