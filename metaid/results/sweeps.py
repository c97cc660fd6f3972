"""Episodes on a line or a plane of candidates: the frequency against a factor (the paper's Table I as a curve) and
the boundary of falling.

They evaluate candidates as the search did, and do not use the truth. On a plant with noise all candidates have that of
trial 0, so that a curve has no noise of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array

if TYPE_CHECKING:
    from metaid.compiled import Objective

STRIDE = 5  # of the points of a plane that are looked at whatever others are like


@dataclass(frozen=True)
class Sweep:
    """One lump's `factors` (n), the measure's `values` (n), NaN where it `fell` (n); the other lumps stay."""

    lump: int
    factors: Array
    values: Array
    fell: NDArray[np.bool_]


@dataclass(frozen=True)
class Plane:
    """Factors of two lumps, `first` (n) and `second` (m), and where it `fell` over them (m x n)."""

    first: Array
    second: Array
    fell: NDArray[np.bool_]


def sweep(objective: Objective, centre: Array, lump: int, factors: Array) -> Sweep:
    """Evaluates candidates that differ in one lump.

    Args:
        objective: of the study.
        centre: factors of all lumps (nlump), which the others keep.
        lump: the index of the one that differs.
        factors: its factors (n).
    """
    candidates = np.tile(centre, (len(factors), 1))
    candidates[:, lump] = factors
    outcomes = [objective.evaluate(candidate) for candidate in candidates]
    fell = np.array([outcome.fell for outcome in outcomes])
    return Sweep(lump, factors, np.where(fell, np.nan, [outcome.value for outcome in outcomes]), fell)


def plane(objective: Objective, centre: Array, lumps: tuple[int, int], first: Array, second: Array) -> Plane:
    """Where candidates fall that differ in two lumps. Where the corners of a cell of STRIDE points a side fare alike,
    all within are taken to; elsewhere the cell is halved along both sides, and so on.

    Args:
        objective: of the study.
        centre: factors of all lumps (nlump), which the others keep.
        lumps: the indices of the two that differ.
        first: factors of the first (n).
        second: factors of the second (m).
    """
    fell = np.zeros((len(second), len(first)), dtype=np.bool_)
    is_known = np.zeros_like(fell)

    def look(row: int, column: int) -> bool:
        if not is_known[row, column]:
            candidate = centre.copy()
            candidate[list(lumps)] = first[column], second[row]
            fell[row, column], is_known[row, column] = objective.evaluate(candidate).fell, True
        return bool(fell[row, column])

    def fill(rows: Sequence[int], columns: Sequence[int]) -> None:
        for (top, bottom), (left, right) in product(pairwise(rows), pairwise(columns)):
            corners = {look(row, column) for row, column in product((top, bottom), (left, right))}
            if len(corners) == 1:
                cell = np.s_[top : bottom + 1, left : right + 1]
                fell[cell] = np.where(is_known[cell], fell[cell], corners.pop())
            elif max(bottom - top, right - left) > 1:
                fill(*(sorted({low, (low + high) // 2, high}) for low, high in ((top, bottom), (left, right))))

    fill(*(sorted({*range(0, len(factors), STRIDE), len(factors) - 1}) for factors in (second, first)))
    return Plane(first, second, fell)
