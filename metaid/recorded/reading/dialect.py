"""How a text of rows is written, as its beginning tells: what separates fields, the decimal sign, names of columns."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from metaid.errors import RecordError

BEGINNING = 1 << 16  # bytes that tell how a text is written
MOST_TITLES = 20  # lines that may stand above the names of columns, comments at the beginning left out
COMMENTS = ("#", "%")  # with which a line begins that has no numbers
NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf)", re.IGNORECASE)


@dataclass(frozen=True)
class Dialect:
    """How a text is written: what separates fields, the decimal sign, the names of columns, and how many lines stand
    above the numbers.
    """

    separator: str
    decimal: str
    names: tuple[str, ...]
    above: int
    encoding: str
    is_nameless: bool = False


def dialect_of(path: Path) -> Dialect:
    """How a text is written, by its beginning.  Raises RecordError where it is empty."""
    with path.open("rb") as file:
        begin = file.read(BEGINNING)
    encoding = _encoding(begin)
    lines = begin.decode(encoding, errors="replace").splitlines()
    if not any(line.strip() for line in lines):
        raise RecordError(f"{path}: not a table: no columns in it")
    commented = next((i for i, line in enumerate(lines) if line.strip() and not line.startswith(COMMENTS)), 0)
    lines = lines[: commented + MOST_TITLES + 50]
    for above, line in enumerate(lines[: commented + MOST_TITLES]):
        separator = _separator(line)
        names = _fields(line.lstrip("#% ") if line.startswith(COMMENTS) else line, separator)
        below = next((other for other in lines[above + 1 :] if other.strip()), COMMENTS[0])
        stand_twice = line.startswith(COMMENTS) and names[1:] == _fields(below, separator)[1:]
        if below.startswith(COMMENTS) or stand_twice:
            continue
        # with or without an end
        counts = {len(_fields(each, separator)) for each in (below, below.rstrip(f"{separator} "))}
        if len(names) > 1 and not any(map(is_number, names)) and len(names) in counts:
            decimal = _decimal(separator, lines[above + 1 :])
            return Dialect(separator, decimal, distinct(names), above + 1, encoding)
    nameless = _nameless(lines, commented, encoding)
    if nameless is not None:
        return nameless
    separator = _separator(lines[commented])
    return Dialect(separator, ".", distinct(_fields(lines[commented], separator)), commented + 1, encoding)


def _nameless(lines: Sequence[str], first: int, encoding: str) -> Dialect | None:
    """How a text is written whose `first` line has numbers alone, or the numbers of its columns; None of another."""
    separator = _separator(lines[first])
    fields = _fields(lines[first].rstrip(f"{separator} "), separator)
    numbers = [each for each in fields if each]
    is_numbered = len(numbers) > 2 and numbers == [*map(str, range(len(numbers)))]  # as pandas writes it
    if not is_numbered and not all(map(is_number, fields)):
        return None
    names = tuple(f"column_{number + 1}" for number in range(len(fields)))
    return Dialect(separator, _decimal(separator, lines[first:]), names, first + is_numbered, encoding, True)


def _separator(line: str) -> str:
    return next((each for each in (";", "\t", ",") if each in line), " ")


def _decimal(separator: str, lines: Sequence[str]) -> str:
    return "," if separator != "," and re.search(r"\d,\d", " ".join(lines)) else "."


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


def is_number(field: str) -> bool:
    return NUMBER.fullmatch(field) is not None


def distinct(names: Sequence[str]) -> tuple[str, ...]:
    """Names of columns, of which a second one of the same name gets a number, as pandas does it."""
    found: list[str] = []
    for name in names:
        count, each = 0, name
        while each in found:
            count += 1
            each = f"{name}.{count}"
        found.append(each)
    return tuple(found)
