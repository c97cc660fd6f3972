"""Files and frames as tables of named columns: CSV as people have it, Parquet, frames. Bags are in `bags.py`, files of
arrays in `arrays.py`.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from metaid.errors import RecordError, optional_packages
from metaid.recorded.reading.arrays import ARRAYS, arrays_frame
from metaid.recorded.reading.bags import BAGS, bag_tables, is_bag
from metaid.recorded.reading.readings import Repair

TEXTS = (".csv", ".tsv", ".txt", ".dat")
SUFFIXES = (*TEXTS, ".parquet", *ARRAYS, *BAGS)
BEGINNING = 1 << 16  # bytes that tell how a text is written
MOST_TITLES = 20  # lines that may stand above the names of columns
NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf)", re.IGNORECASE)
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
    """

    name: str
    columns: tuple[str, ...]
    load: Callable[[Sequence[str]], pd.DataFrame]
    notes: tuple[Repair, ...] = ()
    topic: str | None = None


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
    if frame.index.name is not None or isinstance(frame.index, pd.DatetimeIndex):
        frame = frame.rename_axis(str(frame.index.name or "time")).reset_index()
    frame = frame.set_axis([_flat(column) for column in frame.columns], axis="columns")
    return Table(name, tuple(frame.columns), lambda columns: frame[list(columns)])


def _flat(column: object) -> str:
    return "_".join(map(str, column)) if isinstance(column, tuple) else str(column)


def _parquet(path: Path) -> Table:
    with optional_packages("parquet"):
        from pyarrow import ArrowInvalid
        from pyarrow.parquet import read_schema
    try:
        columns = read_schema(path).names
    except ArrowInvalid as problem:
        raise RecordError(f"{path}: not a table: {problem}") from None
    return Table(str(path), tuple(columns), lambda wanted: pd.read_parquet(path, columns=list(wanted)))


@dataclass(frozen=True)
class _Dialect:
    """How a text is written: what separates fields, the decimal sign, and which line has the names."""

    separator: str
    decimal: str
    names: tuple[str, ...]
    above: int
    encoding: str


def _text(path: Path) -> Table:
    dialect = _dialect(path)
    separator = r"\s+" if dialect.separator == " " else dialect.separator

    def load(columns: Sequence[str], rows: int | None = None) -> pd.DataFrame:
        places = sorted(dialect.names.index(column) for column in columns)
        with pd.option_context("mode.string_storage", "python"):
            frame = pd.read_csv(
                path,
                sep=separator,
                decimal=dialect.decimal,
                skiprows=dialect.above + 1,
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
    names = _named_by_cells(dialect.names, load)
    back = dict(zip(names, dialect.names, strict=True))

    def renamed(columns: Sequence[str]) -> pd.DataFrame:
        return load([back[column] for column in columns]).set_axis(list(columns), axis="columns")

    return Table(str(path), names, renamed, tuple(notes))


def _dialect(path: Path) -> _Dialect:
    """How a text is written, by its beginning.  Raises RecordError where it has no names of columns."""
    with path.open("rb") as file:
        begin = file.read(BEGINNING)
    encoding = _encoding(begin)
    lines = begin.decode(encoding, errors="replace").splitlines()[: MOST_TITLES + 50]
    if not any(line.strip() for line in lines):
        raise RecordError(f"{path}: not a table: no columns in it")
    for above, line in enumerate(lines[:MOST_TITLES]):
        separator = next((each for each in (";", "\t", ",") if each in line), " ")
        names = _fields(line.lstrip("# ") if line.startswith("#") else line, separator)
        below = next((other for other in lines[above + 1 :] if other.strip()), "")
        counts = {_count(each, separator) for each in (below, below.rstrip(f"{separator} "))}  # with or without an end
        if len(names) > 1 and not any(map(_is_number, names)) and len(names) in counts:
            decimal = "," if separator != "," and re.search(r"\d,\d", " ".join(lines[above + 1 :])) else "."
            return _Dialect(separator, decimal, _distinct(names), above, encoding)
    first = next(line for line in lines if line.strip())
    if _is_number(_fields(first, next((each for each in (";", "\t", ",") if each in first), " "))[0]):
        raise RecordError(f"{path}: no names of columns in its first line (allowed: time, angle_1, torque_1, …)")
    separator = next((each for each in (";", "\t", ",") if each in first), " ")
    return _Dialect(separator, ".", _distinct(_fields(first, separator)), lines.index(first), encoding)


def _encoding(begin: bytes) -> str:
    if begin.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        begin[: begin.rfind(b"\n") + 1].decode("utf-8-sig")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def _fields(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    return [field.strip() for field in next(csv.reader([line], delimiter=separator))]


def _count(line: str, separator: str) -> int:
    return len(_fields(line, separator)) if line else 0


def _is_number(field: str) -> bool:
    return NUMBER.fullmatch(field) is not None


def _distinct(names: Sequence[str]) -> tuple[str, ...]:
    """Names of columns, of which a second one of the same name gets a number, as pandas does it."""
    found: list[str] = []
    for name in names:
        count, each = 0, name
        while each in found:
            count += 1
            each = f"{name}.{count}"
        found.append(each)
    return tuple(found)


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
        for kind in ("position", "velocity", "effort"):
            own = f"{match[1]}{kind}{match[2]}"
            if own in names and joint and not _is_number(joint):
                names[names.index(own)] = f"{kind}_{joint}"
    return _distinct(names)
