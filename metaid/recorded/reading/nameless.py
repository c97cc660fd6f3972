"""Tables without names of columns: called as their file where that says what all of it is, else by how they change,
else for the user to say.

Speeds are how fast angles do, accelerations are how fast speeds do, and what is left are torques. A pendulum that
swings freely has none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pandas as pd

from metaid.errors import RecordError
from metaid.models import Array
from metaid.recorded.reading.formats import Table
from metaid.recorded.reading.readings import NO_READING, Repair
from metaid.recorded.reading.times import CLOCKS, FASTEST, SLOWEST, UNITS
from metaid.recorded.reading.words import KIND_OF, tokens_of

# By how many columns a table has for each of n joints, with a time and without: what they usually are.
USUAL = {1: "angle", 2: "angle,torque", 3: "angle,speed,torque", 4: "angle,speed,-{n},torque"}
FEWEST, MOST = 3, 6  # columns of each joint
STRIDES = 200  # of a log, over which changes are compared
LIKE = 0.97  # least correlation of how much angles change with the sum of how fast they do
LIKE_FILTERED = 0.7  # of speeds with accelerations, which are filtered and late
ALIKE = 0.1  # most by which joints differ in how many rows a second has
STILL = 0.01  # of how far the farthest joint goes: one that goes no farther says nothing


def marked(table: Table) -> Table:
    """A table all of whose columns are of one array, of which nothing says what it holds, as one without names. Any
    other as it is.
    """
    word, *others = {column.rpartition("_")[0] for column in table.columns}
    says = not word or others or any(each in KIND_OF or each in CLOCKS for each in tokens_of(word))
    return table if says else replace(table, is_nameless=True)


def called_as_file(table: Table, njoint: int) -> Table:
    """A table without names whose file is called as one kind of readings, `q.txt` or `tau.csv`, with a column of each
    joint, or as a time with one column: its columns by that name. Any other as it is.
    """
    stem = Path(table.name).stem
    tokens = tokens_of(stem)
    is_kind, is_time = any(each in KIND_OF for each in tokens), any(each in CLOCKS for each in tokens)
    count = len(table.columns)
    if not table.is_nameless or is_kind == is_time or count != (njoint if is_kind else 1):
        return table
    names = [stem] if count == 1 else [f"{stem}_{joint + 1}" for joint in range(count)]
    return _named(table, names, f"{Path(table.name).name} is called as what they are")


def recognised(table: Table, njoint: int, rate: float | None, may_swing: bool) -> Table:
    """A table without names with those that its columns must have. Any other as it is, and one of which nothing tells
    what its columns are.

    Args:
        table: the table.
        njoint: of the robot.
        rate: in Hz; where it is not said, and the table has no times, its speeds tell it.
        may_swing: whether the robot may swing freely, so that torques may be missing.
    """
    is_other = any(KIND_OF.get(each, "angle") != "angle" for each in tokens_of(Path(table.name).stem))  # as tau.csv
    count, fewest = len(table.columns), FEWEST if not may_swing else 1 + is_other
    if not table.is_nameless or not fewest * njoint <= count <= MOST * njoint + 1:
        return table
    cells = table.load(table.columns).apply(pd.to_numeric, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan)
    cells = cells[(np.abs(cells) < NO_READING).all(axis=1)]
    found = list(_layouts(cells, njoint, fewest)) if len(cells) > STRIDES else []
    if len(found) != 1:
        return table
    [(names, text, own_rate)] = found
    names = [own or column for own, column in zip(names, table.columns, strict=True)]
    how = f"taken as {text}, by how they change"
    if own_rate is None or rate is not None:
        return _named(table, names, how)
    return _named(table, names, f"{how} at {own_rate:g} Hz").on_rate(own_rate)


def _named(table: Table, names: Sequence[str], how: str) -> Table:
    """A table without names with these of its columns (ncolumn), and a line that says how it has them."""
    note = Repair("columns", len(names), f"no names of columns: {how}")
    return replace(table.renamed(names), notes=(*table.notes, note), is_nameless=False)


def _layouts(cells: Array, njoint: int, fewest: int) -> Iterator[tuple[list[str], str, float | None]]:
    """What cells (nrow x ncolumn) may be: kind after kind of all joints, or joint after joint, after a time perhaps, of
    at least so many kinds. Each as the names of columns, empty where one is not read, a text of them, and the rate, in
    Hz, of one without times.
    """
    alone = njoint == 1
    is_timed = bool((np.diff(cells[:, 0]) > 0.0).all()) if alone else cells.shape[1] % njoint == 1
    times = cells[:, 0] if is_timed else np.arange(len(cells), dtype=np.float64)
    numbers = np.arange(int(is_timed), cells.shape[1])
    if numbers.size % njoint or numbers.size < fewest * njoint or not (np.diff(times) > 0.0).all():
        return
    if numbers.size == njoint and is_timed:
        yield ["time", *(f"angle_{joint + 1}" for joint in range(njoint))], "time, angle of all joints", None
        return
    shapes = {"all joints": numbers.reshape(-1, njoint)}
    if not alone:
        shapes["joint after joint"] = numbers.reshape(njoint, -1).T
    for how, columns in shapes.items():
        for kinds, rate in _kinds([cells[:, own] for own in columns], times, fewest < FEWEST):
            as_said = any(abs(rate * unit - 1.0) < ALIKE for unit in UNITS.values())
            if as_said if is_timed else FASTEST < 1.0 / rate < SLOWEST:
                names = ["time"] * int(is_timed) + [""] * columns.size
                for kind, own in zip(kinds, columns, strict=True):
                    for joint, column in enumerate(own.tolist()):
                        names[column] = f"{kind}_{joint + 1}" if kind else ""
                text = ", ".join(kind or "nothing" for kind in kinds) + f" of {how}"
                yield (names, f"time, {text}", None) if is_timed else (names, text, _usual(rate))


def _kinds(blocks: Sequence[Array], times: Array, may_swing: bool) -> Iterator[tuple[list[str], float]]:
    """What each of several blocks (nrow x njoint each) is, empty of one that is not read, and how many units of time of
    the speeds one of `times` is. There may be no torques where the robot `may_swing` freely.
    """
    moving = [number for number, block in enumerate(blocks) if np.ptp(block, axis=0).any()]
    changes = {pair: _changes(blocks[pair[0]], blocks[pair[1]], times) for pair in permutations(moving, 2)}
    for (angle, speed), (likeness, rates) in changes.items():
        rate = float(np.median(rates))
        if not rate > 0.0 or not (likeness > LIKE).all() or not (np.abs(rates / rate - 1.0) < ALIKE).all():
            continue
        others = [each for each in moving if each not in (angle, speed)]
        faster = [each for each in others if _are_filtered(*changes[speed, each], rate)]
        torque = [each for each in others if each not in faster]
        is_slower = any(_are_filtered(*changes[each, angle], rate) for each in torque)
        if 1 - may_swing <= len(torque) <= 1 and len(faster) <= 1 and not is_slower:
            known = {angle: "angle", speed: "speed"} | dict.fromkeys(torque, "torque")
            yield [known.get(each, "") for each in range(len(blocks))], rate


def _changes(slow: Array, fast: Array, times: Array) -> tuple[Array, Array]:
    """Of each joint that moves (njoint) the correlation between how much what is `slow` (nrow x njoint) changes and the
    sum of what is `fast`, and by how much the sum is larger, of rows at some `times` (nrow).
    """
    stride = max(1, len(times) // STRIDES)
    sums = np.cumsum(0.5 * (fast[1:] + fast[:-1]) * np.diff(times)[:, None], axis=0)
    reach = np.ptp(slow, axis=0)
    moves = reach > STILL * reach.max()
    summed, changed = (each[stride::stride, moves] - each[:-stride:stride, moves] for each in (sums, slow[1:]))
    product, square = (summed * changed).sum(axis=0), (changed**2).sum(axis=0)
    return product / np.maximum(np.sqrt((summed**2).sum(axis=0) * square), 1e-300), product / square


def _are_filtered(likeness: Array, rates: Array, rate: float) -> bool:
    """Whether something is how fast something else changes, perhaps through a filter: smaller and late."""
    return bool(np.median(likeness) > LIKE_FILTERED and 0.5 < np.median(rates) / rate < 2.0)


def _usual(rate: float) -> float:
    """A round rate near by: most logs are told to have one, and have a little more or less."""
    for digits, share in ((1, 0.02), (2, 0.005), (3, 0.005), (4, 0.005)):
        near = float(f"{rate:.{digits}g}")
        if abs(near / rate - 1.0) < share:
            break
    return near


def refusal(table: Table, njoint: int) -> RecordError:
    """What is said of a table without names of which nothing says what its columns are."""
    count = len(table.columns)
    has_time = njoint == 1 < count  # of one joint that is likelier than none
    each, others = (count - 1, 1) if has_time else divmod(count, njoint)
    usual = USUAL.get(each, USUAL[3]).format(n=njoint)
    time, rate = ("", " and --rate HZ") if others == 0 and each in USUAL else ("time,", "")
    return RecordError(
        f"{table.name}: no names of its {count} columns (allowed: a first line time, angle_1, torque_1, …; or what they"
        f" are in their order, as --map {table.columns[0].rpartition('_')[0]}={time}{usual}{rate})"
    )
