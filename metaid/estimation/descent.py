"""Levenberg and Marquardt's descent in the form of Moré (Eq. 26).

A step is the full Gauss-Newton step, unless that is longer than the linear model of the residuals has proved to hold.
Then it is damped to that length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from metaid.models import Array

LONGEST_STEP = 0.5  # in a log factor: a factor of 1.65
SHORTEST_STEP = 1e-10
NOTHING = 1e-6  # of cost, where a residual of one unit costs 0.5; a step that gains less is the last,
NEGLIGIBLE_SHARE = 1e-9  # as is one that gains less than this share of the cost: what remains is not explained
FARTHEST = 6.0  # standard deviations of the prior; no chain beyond is tried
POOR, GOOD = 0.25, 0.75  # shares of the promised gain, below and above which the next step is shorter or longer
FOLLOWED = 0.1  # share of the cost that what concerns a push alone may still gain where a step changes nothing else
NEARLY = 0.8  # of the longest step that holds, so long at least is one that was cut to it
BISECTIONS = 40


@dataclass(frozen=True)
class Residuals:
    """`values` (nresidual), scaled by what noise or rounding explains, and their `slopes` (nresidual x nunknown).

    `cost` is half the sum of squares of all `count` residuals. It may be more than that of these `values`: unknowns
    that concern one push alone are not in `slopes`, and in `values` they are already where they serve best.
    `following` (nextra x 1 + nunknown) says where that is: the step to there, and what a step of each unknown adds.
    """

    values: Array
    slopes: Array
    cost: float
    count: int
    following: Array

    @property
    def misfit(self) -> float:
        """Root mean square of all of them, scaled by what noise or rounding explains."""
        return float(np.sqrt(2.0 * self.cost / self.count))


class Fitted(Protocol):
    """What is fitted: residuals as a function of unknowns, on windows that grow from stage to stage."""

    @property
    def spreads(self) -> Array:
        """Standard deviation (nunknown) of the prior of each unknown, whose mean is 0."""

    @property
    def stages(self) -> int:
        """How many windows there are."""

    @property
    def extras(self) -> int:
        """How many unknowns there are that concern one push alone."""

    def residuals(self, point: Array, windows: int) -> Residuals | None:
        """Those of the first `windows` windows at a `point`: the unknowns (nunknown), and behind them those that
        concern one push alone. None where the twin cannot follow.
        """

    def least_cost(self, point: Array, windows: int) -> float:
        """What these residuals cost at least, by less work than they take: inf where the twin cannot follow, 0 where
        nothing less tells it.
        """


@dataclass(frozen=True)
class Place:
    """Where a descent is: the `point`, its `residuals`, its `cost` with that of the prior."""

    point: Array
    residuals: Residuals
    cost: float


@dataclass(frozen=True)
class Descent:
    """Where a descent ended, after how many steps, and whether because none led lower."""

    place: Place
    iterations: int
    converged: bool


def place_at(fitted: Fitted, point: Array, windows: int, below: float = np.inf) -> Place | None:
    """The place at a point, or None where it is too far from the prior's mean, the twin cannot follow, or its cost is
    plainly not below one.

    Args:
        fitted: what is fitted.
        point: all unknowns (nunknown + nextra).
        windows: how many windows of each push are compared, from the shortest on.
        below: a cost; by default any will do.
    """
    spreads = fitted.spreads
    prior = point[: len(spreads)] / spreads
    if not float(np.abs(prior).max()) <= FARTHEST:
        return None
    if below < np.inf and not fitted.least_cost(point, windows) + 0.5 * float(prior @ prior) < below:
        return None
    residuals = fitted.residuals(point, windows)
    if residuals is None or not np.isfinite(residuals.cost):
        return None
    return Place(point, residuals, residuals.cost + 0.5 * float(prior @ prior))


def triangle(place: Place, spreads: Array) -> tuple[Array, Array]:
    """R (nunknown x nunknown), upper triangular, and b (nunknown), so that a step s lowers the cost most where R s = b:
    the residuals' model and the prior, orthogonally reduced.
    """
    count = len(spreads)
    prior = np.column_stack([np.diag(1.0 / spreads), place.point[:count] / spreads])
    seen = np.column_stack([place.residuals.slopes, place.residuals.values])
    reduced: Array = np.asarray(np.linalg.qr(np.vstack([seen, prior]), mode="r"))
    return reduced[:count, :count], -reduced[:count, count]


def covariance_at(place: Place, spreads: Array) -> Array:
    """Of the unknowns (nunknown x nunknown) at a place where no step lowers the cost.  Eq. 27."""
    inverse = np.linalg.inv(triangle(place, spreads)[0])  # R is the factor of what is inverted
    return np.asarray(inverse @ inverse.T, dtype=np.float64)


def descend(
    fitted: Fitted,
    place: Place,
    windows: int,
    tolerance: float,
    most: int,
    ends_when_cut: bool = True,
    least_gain: float = NOTHING,
) -> Descent:
    """Steps downhill from a place until a step changes or gains nothing.

    Args:
        fitted: what is fitted.
        place: where the descent begins.
        windows: how many windows of each push are compared, from the shortest on.
        tolerance: the change of each unknown below which a step changes nothing, once what concerns a push alone has
            followed.
        most: the largest number of steps.
        ends_when_cut: whether a step that short is the last where it was cut, too, for a longer one led nowhere.
        least_gain: of cost; a step that promises less is not made.
    """
    radius = LONGEST_STEP
    for iteration in range(most):
        factor, target = triangle(place, fitted.spreads)
        by_starts = _gain_by_following(place, fitted.spreads)
        is_first = True  # of the steps that are tried from here
        while True:
            step = step_within(factor, target, radius)
            size = float(np.abs(step).max())
            left = factor @ step - target
            gain = 0.5 * float(target @ target - left @ left) + by_starts
            is_short = size < SHORTEST_STEP and not (is_first and by_starts > least_gain)
            if gain < max(least_gain, NEGLIGIBLE_SHARE * place.cost) or is_short:
                return Descent(place, iteration, True)
            following = place.residuals.following @ np.append(1.0, step)
            new = place_at(fitted, place.point + np.concatenate([step, following]), windows, place.cost)
            share = -1.0 if new is None else (place.cost - new.cost) / gain
            if new is not None and share > 0.0:
                break
            radius, is_first = POOR * size, False
        is_cut = size >= NEARLY * radius
        if share < POOR:
            radius = 0.5 * size
        elif share > GOOD:
            radius = min(LONGEST_STEP, max(radius, 2.0 * size))
        place = new
        is_followed = _gain_by_following(place, fitted.spreads) < FOLLOWED * place.cost
        if size < tolerance and is_followed and (ends_when_cut or not is_cut):
            return Descent(place, iteration + 1, True)
    return Descent(place, most, False)


def _gain_by_following(place: Place, spreads: Array) -> float:
    """By how much the cost falls where what concerns a push alone goes to where it serves best, and nothing else."""
    if not len(place.residuals.following):
        return 0.0
    values, prior = place.residuals.values, place.point[: len(spreads)] / spreads
    return max(place.cost - 0.5 * float(values @ values + prior @ prior), 0.0)


def step_within(factor: Array, target: Array, radius: float) -> Array:
    """The step s (nunknown) that minimises |R s − b|² + λ |s|², λ being 0 if no unknown then changes by more than
    `radius`, or else so large that the largest change is NEARLY all of it.  Eq. 26.
    """
    from scipy.linalg import solve_triangular  # which a command that only reads a DB does without

    step: Array = solve_triangular(factor, target)
    if float(np.abs(step).max()) <= radius:
        return step
    left, singular, right = np.linalg.svd(factor)
    turned = left.T @ target
    low, high = 2.0 * np.log(singular[-1]) - 20.0, 2.0 * np.log(singular[0]) + 40.0
    for _ in range(BISECTIONS):
        damping = 0.5 * (low + high)
        step = right.T @ (singular * turned / (singular**2 + np.exp(damping)))
        size = float(np.abs(step).max())
        if NEARLY * radius <= size <= radius:
            break
        low, high = (damping, high) if size > radius else (low, damping)
    return step
