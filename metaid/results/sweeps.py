"""Episodes on a line or a plane of candidates: the frequency against a factor (the paper's Table I as a curve) and
the boundary of falling.

They evaluate candidates as the search did, and do not use the truth. On a plant with noise all candidates have that of
trial 0, so that a curve has no noise of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array

if TYPE_CHECKING:
    from metaid.compiled import Objective


@dataclass(frozen=True)
class Sweep:
    """One lump's `factors` (n), the measure's `values` (n), NaN where it `fell` (n); the other lumps stay."""

    lump: int
    factors: Array
    values: Array
    fell: NDArray[np.bool_]


@dataclass(frozen=True)
class Plane:
    """Factors of two lumps, `first` (n) and `second` (m), and the `values` (m x n) over them, NaN where it fell."""

    first: Array
    second: Array
    values: Array


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
    """Evaluates candidates that differ in two lumps.

    Args:
        objective: of the study.
        centre: factors of all lumps (nlump), which the others keep.
        lumps: the indices of the two that differ.
        first: factors of the first (n).
        second: factors of the second (m); all pairs are evaluated.
    """
    rows = []
    for factor in second:
        here = centre.copy()
        here[lumps[1]] = factor
        rows.append(sweep(objective, here, lumps[0], first).values)
    return Plane(first, second, np.array(rows))
