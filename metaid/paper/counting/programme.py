"""Linear programmes about a model: which changes of the unknowns make the counts right, and how far they may go.

A count is right where its phase is in the right half turn, and where as many extrema have crossed the upright as with
the plant. To first order in the unknowns both are linear inequalities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from metaid.estimation import MISS, TOP
from metaid.models import Array
from metaid.paper.counting.counts import Counted

FARTHEST = 1.0  # of a log factor from where the inequalities were made


@dataclass(frozen=True, eq=False)
class Inequalities:
    """A x ≤ b for a change x (nunknown) of the unknowns; `left` A (nrow x nunknown), `right` b (nrow).  Eqs. 30, 31."""

    left: Array
    right: Array

    @property
    def violation(self) -> float:
        """By how much the model itself, x = 0, violates them, in all."""
        return float(np.maximum(-self.right, 0.0).sum())

    def nearest(self, reach: float) -> tuple[Array, float] | None:
        """The change of at most `reach` in each unknown that violates them least in all, and by how much."""
        from scipy.sparse import csc_matrix, hstack, identity  # slow to load, and only counts need it

        near = self.right < reach * np.abs(self.left).sum(axis=1)
        left, right = self.left[near], self.right[near]
        unknowns, rows = left.shape[1], len(right)
        cost = np.concatenate([np.zeros(unknowns), np.ones(rows)])
        system = hstack([csc_matrix(left), -identity(rows, format="csc")], format="csc")
        bounds = [(-reach, reach)] * unknowns + [(0.0, None)] * rows
        found = _least(cost, system, right, bounds)
        return None if found.x is None else (found.x[:unknowns], float(found.fun))

    def deepest(self) -> Array | None:
        """The change (nunknown) that is farthest from violating any; None where each violates one."""
        rows, unknowns = self.left.shape
        system = np.column_stack([self.left, np.ones(rows)])
        bounds = [(-FARTHEST, FARTHEST)] * unknowns + [(0.0, None)]
        cost = np.append(np.zeros(unknowns), -1.0)
        found = _least(cost, system, self.right, bounds)
        return None if found.x is None else np.asarray(found.x[:unknowns])

    def extremes(self, directions: Array) -> Array | None:
        """The changes (2 x ndirection x nunknown) that violate none and go least and most far along each of the
        `directions` (ndirection x nunknown); None where each violates one.
        """
        found = np.zeros((2, *directions.shape))
        bounds = [(-FARTHEST, FARTHEST)] * directions.shape[1]
        for end, sign in enumerate((1.0, -1.0)):
            for k, direction in enumerate(directions):
                vertex = _least(sign * direction, self.left, self.right, bounds).x
                if vertex is None:
                    return None
                found[end, k] = vertex
        return found


def _least(cost: Array, left: Any, right: Array, bounds: Sequence[tuple[float | None, float | None]]) -> Any:
    """SciPy's result of the linear programme that makes `cost` · x least, subject to `left` x ≤ `right`.

    Args:
        cost: of each variable (nvariable).
        left: a matrix (nrow x nvariable), dense or sparse.
        right: (nrow).
        bounds: of each variable.
    """
    from scipy.optimize import linprog  # slow to load, and only counts need it

    return linprog(cost, A_ub=left, b_ub=right, bounds=bounds, method="highs")


def sides(counted: Counted, margin: float = 0.0) -> Inequalities:
    """Every joint is on the right side of the upright at the end of every window, by a `margin` of half turns.

    Eq. 30.
    """
    off, half = counted.deviations(by_side=True), 0.5 - margin
    left = np.vstack([counted.slopes, -counted.slopes])
    return Inequalities(left, np.concatenate([half - off, half + off]))


def pairs(counted: Counted, margin: float = 0.0) -> Inequalities:
    """And no extremum crosses the upright in a window whose count is right, but one does in a window that has gained or
    lost a pair of crossings, by a `margin`.  Eq. 31.
    """
    first = sides(counted, margin)
    left, right = [first.left], [first.right]
    for kind, sign in ((MISS, -1), (TOP, 1)):
        touches, slopes = counted.touches[:, kind], counted.touch_slopes[:, kind]
        known = np.isfinite(touches)
        wrong = known & (sign * counted.gained > 0) & (counted.gained % 2 == 0)
        kept = known & (counted.gained == 0)
        left += [slopes[wrong], -slopes[kept]]
        right += [-margin - touches[wrong], touches[kept] - margin]
    return Inequalities(np.vstack(left), np.concatenate(right))
