"""How a table fits the width of a terminal: nothing in it is ever cut.

First headings and words are broken over lines. Then columns are left out: those that say nothing, then those that
the command can do without, in the order that it states; a line below names them. What is still too wide is printed as
a list of entries, a cell a line.
"""

from __future__ import annotations

import os
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TextIO

from rich.cells import cell_len

from metaid.frames import UNKNOWN

UNBROKEN = 24  # letters of a name; a longer text is broken over lines
GAPS = (3, 2, 1)  # spaces between two columns: as many as there is room for
UNLIMITED = 160  # letters of a pipe, which has no width of its own


@dataclass(frozen=True)
class Column:
    """A `heading`, the `cells` below it, and whether these are words (aligned left, and broken over lines)."""

    heading: str
    cells: tuple[str, ...]
    is_words: bool

    @property
    def most(self) -> int:
        """How wide it is where nothing is broken over lines."""
        return max(map(cell_len, (self.heading, *self.cells)))

    @property
    def least(self) -> int:
        """How narrow it can be: numbers and names are never broken."""
        head = max(map(cell_len, self.heading.split()), default=0)
        cells = max(map(cell_len, self.cells), default=0)
        return max(head, min(cells, UNBROKEN) if self.is_words else cells, 1)

    @property
    def says_nothing(self) -> bool:
        """Whether no cell has a value."""
        return all(cell in ("", UNKNOWN) for cell in self.cells)


@dataclass(frozen=True)
class Layout:
    """The `columns` that are shown, how wide each is (`widths`), the `gap` between them, and the headings of those that
    are `left_out`. Where even these are too wide, `widths` are empty.
    """

    columns: tuple[Column, ...]
    widths: tuple[int, ...]
    gap: int
    left_out: tuple[str, ...]


def terminal_width(stream: TextIO | None = None) -> int | None:
    """How many letters a line of a `stream` has, of stdout if not stated; None where it is no terminal."""
    stream = sys.stdout if stream is None else stream
    if not stream.isatty():
        return None
    stated = os.environ.get("COLUMNS", "")
    if stated.isdigit() and int(stated) > 0:
        return int(stated)
    try:
        return os.get_terminal_size(stream.fileno()).columns or None
    except (OSError, ValueError):
        return None


def wrapped(text: str, stream: TextIO) -> str:
    """A line of text as it is printed on a `stream`: on a terminal broken between words where it is too long."""
    width = terminal_width(stream)
    if width is None or cell_len(text) <= width:
        return text.rstrip()
    return "\n".join(textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False))


def laid_out(columns: Sequence[Column], dispensable: Sequence[str], width: int | None) -> Layout:
    """How `columns` are shown in a `width`, or without a limit; those that are `dispensable` are left out in their
    order.
    """
    columns = tuple(columns)
    room = max(UNLIMITED, _needed([column.most for column in columns], GAPS[0])) if width is None else width
    first = [column.heading for column in columns if column.says_nothing and column.heading in dispensable]
    order = [*first, *(heading for heading in dispensable if heading not in first)]
    for count in range(len(order) + 1):
        kept = tuple(column for column in columns if column.heading not in order[:count])
        for gap in GAPS:
            if _needed([column.least for column in kept], gap) <= room:
                left_out = tuple(column.heading for column in columns if column not in kept)
                return Layout(kept, _widths(kept, room - _needed([0] * len(kept), gap)), gap, left_out)
    return Layout(columns, (), GAPS[0], ())


def _needed(widths: Sequence[int], gap: int) -> int:
    edge = 2 if gap == GAPS[0] else 1  # spaces before the first column, and after the last
    return sum(widths) + gap * (len(widths) - 1) + 2 * edge


def _widths(columns: Sequence[Column], room: int) -> tuple[int, ...]:
    """How wide each column is, where their cells have so much `room` in all: numbers take what they need first, words
    share what is left.
    """
    widths = [column.least for column in columns]
    for i, column in enumerate(columns):
        if not column.is_words:
            widths[i] = min(column.most, widths[i] + room - sum(widths))
    words = sorted((column.most, i) for i, column in enumerate(columns) if column.is_words)
    for left, (most, i) in zip(range(len(words), 0, -1), words, strict=True):
        widths[i] = min(most, widths[i] + max(room - sum(widths), 0) // left)
    return tuple(widths)
