"""Files and frames as tables of named columns: CSV as people have it, Parquet, frames. Bags are in `bags.py`, files of
arrays in `arrays.py`.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from metaid.errors import RecordError, optional_packages
from metaid.recorded.reading.arrays import ARRAYS, arrays_frame
from metaid.recorded.reading.bags import BAGS, KINDS, bag_tables, is_bag
from metaid.recorded.reading.dialect import dialect_of, distinct, is_number
from metaid.recorded.reading.lists import has_lists, spread
from metaid.recorded.reading.readings import Repair

TEXTS = (".csv", ".tsv", ".txt", ".dat", ".log")
SUFFIXES = (*TEXTS, ".parquet", *ARRAYS, *BAGS)
NAMED = re.compile(r"(.*?)name(\d+)$")


@dataclass(frozen=True)
class Table:
    """A log as a table.

    Attributes:
        name: of the file, for messages.
        columns: the names of its columns.
        load: reads some of the columns.
        notes: how it is written, where that is not the usual way.
        topic: of a bag.
        is_nameless: whether the file has no names of columns, so that these are `column_1`, `column_2` and so on, or
            those of one array.
    """

    name: str
    columns: tuple[str, ...]
    load: Callable[[Sequence[str]], pd.DataFrame]
    notes: tuple[Repair, ...] = ()
    topic: str | None = None
    is_nameless: bool = False

    def renamed(self, names: Sequence[str]) -> Table:
        """The same table with other `names` of its columns (ncolumn)."""
        back = dict(zip(names, self.columns, strict=True))

        def load(columns: Sequence[str]) -> pd.DataFrame:
            return self.load([back[column] for column in columns]).set_axis(list(columns), axis="columns")

        return replace(self, columns=tuple(names), load=load)

    def is_called(self, names: Iterable[str]) -> bool:
        """Whether some `names` are those of columns, or what several columns are called but for their number."""
        return any(each in self.columns or f"{each}_1" in self.columns for each in names)

    def on_rate(self, rate: float, counter: str = "time") -> Table:
        """The same table with times in s, of so many rows a second: in the column of a `counter`, where it has one, the
        numbers of its rows become times.
        """
        is_counted = counter in self.columns

        def load(columns: Sequence[str]) -> pd.DataFrame:
            frame = self.load([column for column in columns if is_counted or column != counter])
            rows = pd.to_numeric(frame[counter], errors="coerce") if is_counted else np.arange(len(frame))
            return frame.assign(**{counter: rows / rate})[list(columns)]

        return replace(self, columns=self.columns if is_counted else (counter, *self.columns), load=load)


def tables_of(log: str | Path | pd.DataFrame, number: int, topic: str | None) -> list[Table]:
    """The tables in a log: one of a file or frame, and of a bag one a topic.

    Args:
        log: the path of the file, or the frame.
        number: of the log among several, for a frame, which has no name.
        topic: of a bag, where it has several.

    Raises:
        RecordError: it cannot be read.
        MissingExtraError: a package for its format is not installed.
    """
    if isinstance(log, pd.DataFrame):
        return [_of_frame(f"frame {number}", log)]
    path = Path(log)
    try:
        if is_bag(path):
            every = bag_tables(path, topic)
            return [replace(_of_frame(str(path), frame), notes=notes, topic=name) for name, frame, notes in every]
        if path.suffix not in SUFFIXES:
            raise RecordError(f"{path}: the ending says the format (allowed: {', '.join(SUFFIXES)})")
        if path.suffix in ARRAYS:
            return [_of_frame(str(path), arrays_frame(path))]
        return [_parquet(path) if path.suffix == ".parquet" else _text(path)]
    except OSError as problem:
        why = problem.strerror or "not a file of that format"
        raise RecordError(f"{path}: {why} (allowed: the path of a log)") from None
    except (ValueError, csv.Error, pd.errors.ParserError) as problem:
        raise RecordError(f"{path}: not a table: {problem}") from None


def _of_frame(name: str, frame: pd.DataFrame) -> Table:
    """A frame with its index as a column, and columns that only count without names; of columns with one name and the
    same cells the first is kept.  Raises RecordError where their cells differ.
    """
    is_nameless = isinstance(frame.columns, pd.RangeIndex)
    if is_nameless:
        frame = frame.set_axis([f"column_{number + 1}" for number in range(frame.shape[1])], axis="columns")
    index = str(frame.index.name or "time")
    if (frame.index.name is not None or isinstance(frame.index, pd.DatetimeIndex)) and index not in frame.columns:
        frame = frame.rename_axis(index).reset_index()
    frame = frame.set_axis([_flat(column) for column in frame.columns], axis="columns")
    frame = spread(frame) if has_lists(frame) else frame
    again = frame.columns.duplicated()
    for column in frame.columns[again]:
        first, *others = (each for _, each in frame[column].items())
        if not all(first.equals(other) for other in others):
            raise RecordError(f"{name}: several columns are called '{column}' (allowed: one of each name)")
    frame = frame.loc[:, ~again]
    return Table(name, tuple(frame.columns), lambda columns: frame[list(columns)], is_nameless=is_nameless)


def _flat(column: object) -> str:
    return "_".join(map(str, column)) if isinstance(column, tuple) else str(column)


def _parquet(path: Path) -> Table:
    with optional_packages("parquet"):
        from pyarrow import parquet, types
    schema = parquet.read_schema(path)
    if any(types.is_nested(each) for each in schema.types):
        return _of_frame(str(path), pd.read_parquet(path))
    return Table(str(path), tuple(schema.names), lambda wanted: pd.read_parquet(path, columns=list(wanted)))


def _text(path: Path) -> Table:
    dialect = dialect_of(path)
    separator = r"\s+" if dialect.separator == " " else dialect.separator

    def load(columns: Sequence[str], rows: int | None = None) -> pd.DataFrame:
        places = sorted(dialect.names.index(column) for column in columns)
        with pd.option_context("mode.string_storage", "python"):
            frame = pd.read_csv(
                path,
                sep=separator,
                decimal=dialect.decimal,
                skiprows=dialect.above,
                header=None,
                names=range(len(dialect.names)),
                usecols=places,
                index_col=False,
                skipinitialspace=True,
                low_memory=False,
                encoding=dialect.encoding,
                nrows=rows,
            )
        return frame.set_axis([dialect.names[place] for place in places], axis="columns")[list(columns)]

    notes = []
    if dialect.separator != "," or dialect.decimal != ".":
        between = {"\t": "tabs", " ": "blanks"}.get(dialect.separator, f"'{dialect.separator}'")
        decimals = ", with decimal commas" if dialect.decimal == "," else ""
        notes.append(Repair("format", 1, f"columns are separated by {between}{decimals}"))
    if has_lists(load(dialect.names, 1)):
        return replace(_of_frame(str(path), load(dialect.names)), notes=tuple(notes))
    table = Table(str(path), dialect.names, load, tuple(notes), is_nameless=dialect.is_nameless)
    return table.renamed(_named_by_cells(dialect.names, load))


def _named_by_cells(columns: tuple[str, ...], load: Callable[[Sequence[str], int], pd.DataFrame]) -> tuple[str, ...]:
    """Names of columns with those of joints that cells say: `rostopic echo -p` writes `field.name0` with the name of
    the joint that `field.position0` is of.
    """
    said = [(column, match) for column in columns if (match := NAMED.fullmatch(column))]
    if not said:
        return columns
    first = load([column for column, _ in said], 1)
    names = list(columns)
    for column, match in said:
        joint = str(first[column].iloc[0]) if len(first) else ""
        for kind in KINDS:
            own = f"{match[1]}{kind}{match[2]}"
            if own in names and joint and not is_number(joint):
                names[names.index(own)] = f"{kind}_{joint}"
    return distinct(names)
