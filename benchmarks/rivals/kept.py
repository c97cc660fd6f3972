"""The results that docs/peers.md states: kept in the repository, in a line each, and measured anew to see that they
repeat.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.rivals.answers import EXACT
from benchmarks.rivals.comparing import METHODS, Cell
from benchmarks.rivals.conditions import CONDITIONS
from benchmarks.rivals.judging import Error

KEPT = Path(__file__).parents[1] / "peers.csv"
CONDITION, METHOD = ({name: place for place, name in enumerate(names)} for names in (CONDITIONS, METHODS))
COLUMNS = tuple(field.name for field in fields(Cell))
NUMBERS = {"links": int, "seed": int, "budget": int, "motion": float, "torque": float, "range": float, "cpu": float}
ERRORS = tuple(field.name for field in fields(Error))
DIGITS = 4  # the tables show two
REPEATED = 0.05  # errors differ by no more between processors, whose arithmetic rounds differently


def write_cells(cells: Iterable[Cell], path: Path = KEPT) -> None:
    """Keeps `cells`, in the order of what they are of. Errors with each setting of a filter follow one another."""

    def shown(value: Any) -> str:
        if isinstance(value, list):
            return " ".join(shown(error[name]) for error in value for name in ERRORS)
        return f"{value:.{DIGITS}g}" if isinstance(value, float) else str(value)

    ordered = sorted(cells, key=_place)
    rows = ([shown(getattr(cell, name)) for name in COLUMNS] for cell in ordered)
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])


def _place(cell: Cell) -> tuple[int, ...]:
    return CONDITION[cell.condition], METHOD[cell.method], cell.links, cell.seed, cell.budget


def read_cells(path: Path = KEPT) -> list[Cell]:
    """The cells of a file."""
    with path.open(encoding="utf-8", newline="") as file:
        return [_cell(row) for row in csv.DictReader(file)]


def _cell(row: dict[str, str]) -> Cell:
    errors = np.array(row["errors"].split(), float).reshape(-1, len(ERRORS)).tolist()
    read: dict[str, Any] = {name: NUMBERS.get(name, str)(value) for name, value in row.items()}
    return Cell(**read | {"errors": [dict(zip(ERRORS, error, strict=True)) for error in errors]})


def differences(kept: Sequence[Cell], anew: Sequence[Cell]) -> list[str]:
    """Which cells that were measured `anew` are otherwise than the same ones that are kept, in a line each."""
    before = {(cell.sampler, cell.links, cell.seed): cell for cell in kept}
    found = []
    for cell in anew:
        was = before[cell.sampler, cell.links, cell.seed]
        if cell.verdict != was.verdict or not _repeats(_errors(was), _errors(cell)):
            kept_as, measured = (f"{_errors(each).max(axis=1)} {each.verdict}".strip() for each in (was, cell))
            found.append(f"{cell.sampler}, {cell.links} links, seed {cell.seed}: kept {kept_as}, measured {measured}")
    return found


def _errors(cell: Cell) -> Any:
    """The errors of a cell (nsetting x 4)."""
    return np.array([[error[name] for name in ERRORS] for error in cell.errors])


def _repeats(before: Any, after: Any) -> bool:
    if before.shape != after.shape:
        return False
    same = np.isclose(after, before, rtol=REPEATED, atol=0.0) | (np.maximum(before, after) <= EXACT)
    return bool(same.all())
