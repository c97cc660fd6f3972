"""Tables without names of columns: called as their file where that says what all of it is, else for the user to say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from metaid.errors import RecordError
from metaid.recorded.reading.formats import Table
from metaid.recorded.reading.readings import Repair
from metaid.recorded.reading.times import CLOCKS
from metaid.recorded.reading.words import KIND_OF, tokens_of

# By how many columns a table has for each of n joints, with a time and without: what they usually are.
USUAL = {1: "angle", 2: "angle,torque", 3: "angle,speed,torque", 4: "angle,speed,-{n},torque"}


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
    note = Repair("columns", count, f"no names of columns: {Path(table.name).name} is called as what they are")
    return replace(table.renamed(names), notes=(*table.notes, note), is_nameless=False)


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
