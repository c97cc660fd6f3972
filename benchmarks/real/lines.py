"""What is printed: tables, and a line for each thing that was asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Table:
    """Rows under a title."""

    title: str
    rows: list[dict[str, Any]]


@dataclass(frozen=True)
class Line:
    """A number that is to be at most `bound`, or at least."""

    what: str
    number: float
    bound: float
    at_least: bool = False

    @property
    def holds(self) -> bool:
        return self.number >= self.bound if self.at_least else self.number <= self.bound

    @property
    def text(self) -> str:
        side = "at least" if self.at_least else "at most"
        return f"{'holds' if self.holds else 'FAILS'}: {self.what}: {self.number:.4g} ({side} {self.bound:g})"
