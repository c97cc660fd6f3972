"""The fit of the twin to what all trials of a study showed: from the shortest windows to the longest, and once more
from elsewhere where it ends in a wrong minimum.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from metaid.estimation.descent import Descent, Fitted, descend, place_at, triangle
from metaid.estimation.trials import Replay
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array, Lumps

ROUGHLY, EXACTLY = 1e-2, 1e-10  # the last step in a log factor: on windows that are to grow, and on all of them
MOST_ROUGH, MOST_EXACT = 30, 100  # steps
IN_THE_VALLEY = 3.0  # a misfit below this, on windows that are to grow, is not that of a wrong minimum
NARROWER = 0.7  # of the spread about a start that no chain can have, for the next start
DRAWS = 20


class Comparison(Fitted, Protocol):
    """What is compared: `Motions` of a plant without noise, or `Readings` of noisy sensors."""

    @property
    def unknowns(self) -> Unknowns:
        """The lumps that are unknown."""

    @property
    def stride(self) -> int:
        """By how many windows the fit goes on at once, a power of two."""

    @property
    def explained_below(self) -> float:
        """A misfit below this says that the model explains what was seen."""

    def by_joint(self, point: Array) -> tuple[Array, ...]:
        """Root mean square of the residuals of each trial (npush x njoint)."""

    def replay(self, number: int, point: Array) -> Replay:
        """The trial of that `number`, and the twin at a `point` in its place."""


@dataclass(frozen=True)
class Estimate:
    """What all trials say of a chain.

    Attributes:
        names: the lumps that were unknown (nunknown).
        lumps: the chain's lumps; those that were known are the nominal's.
        log_factors: z (nunknown); a lump is e^z times the nominal's.
        covariance: of the log factors (nunknown x nunknown), so of relative errors.
        cost: half the sum of squares of the residuals, with that of the prior.
        misfit: root mean square of the residuals, in units of what noise or rounding explains.
        explained_below: a misfit below this says that the model explains what was seen.
        iterations: steps of all descents.
        starts: how many descents there were, each from another point.
        converged: whether the last steps changed nothing any more.
        residuals: of each trial by push and joint (npush x njoint), root mean square over the windows.
        extras: the unknowns that concern one push alone (nextra): start speeds in units of what pushes differ by, or
            none where these are read.
        extent: least and largest log factor (2 x nunknown) of the models that show exactly the counts that were seen;
            None where no counts were compared, or no model shows them. Half of it is 1.96 times the deviation.
        counts: how many counts were compared, of which the misfit is the number that differs; None where none were.
    """

    names: tuple[str, ...]
    lumps: Lumps
    log_factors: Array
    covariance: Array
    cost: float
    misfit: float
    explained_below: float
    iterations: int
    starts: int
    converged: bool
    residuals: tuple[Array, ...]
    extras: Array
    extent: Array | None = None
    counts: int | None = None

    @property
    def is_explained(self) -> bool:
        """Whether the model explains what was seen."""
        return self.misfit < self.explained_below

    @property
    def point(self) -> Array:
        """All unknowns (nunknown + nextra) of the fit."""
        return np.append(self.log_factors, self.extras)

    @property
    def deviations(self) -> Array:
        """Standard deviation of each log factor (nunknown)."""
        return np.sqrt(np.diag(self.covariance))

    def deviations_of(self, names: Sequence[str]) -> Array:
        """The standard deviation of each of these lumps (nlump), as a share of it.

        With exact lengths a_ij = l_i μ_j is as well known as μ_j.
        """
        return self._by_name(self.deviations, names)

    def extent_of(self, names: Sequence[str]) -> tuple[Array, Array] | None:
        """The least and the largest log factor of each of these lumps (nlump), or None where no extent is known."""
        if self.extent is None:
            return None
        return self._by_name(self.extent[0], names), self._by_name(self.extent[1], names)

    def _by_name(self, values: Array, names: Sequence[str]) -> Array:
        """The `values` (nunknown) of the lumps of these names (nlump)."""
        known = dict(zip(self.names, values.tolist(), strict=True))
        return np.array([known.get(name, known.get(f"gravity_{name.rpartition('_')[2]}", np.nan)) for name in names])

    def interval(self, deviations: float = 1.96) -> tuple[Array, Array]:
        """Least and largest factor (nunknown) within so many standard `deviations`: 95 % of them by default.

        Eq. 27.
        """
        reach = deviations * self.deviations
        return np.exp(self.log_factors - reach), np.exp(self.log_factors + reach)


def fit(comparison: Comparison, start: Array | None = None, restarts: int = 3, seed: int = 0) -> Estimate:
    """The estimate that all trials of a `comparison` lead to.

    Args:
        comparison: what is compared with the twin.
        start: log factors (nunknown) to try before the nominal model, such as those of the estimate before.
        restarts: how often the fit may begin at a random point of the prior, where the misfit says that it ended in a
            wrong minimum.
        seed: of these points; the same seed gives the same estimate.

    Raises:
        ValueError: the twin cannot follow the trials from any start.
    """
    best: Descent | None = None
    iterations = starts = 0
    for point in starting_points(comparison, start, restarts, seed):
        found = grow(comparison, np.append(point, np.zeros(comparison.extras)))
        if found is None:
            continue
        starts += 1
        iterations += found.iterations
        if best is None or found.place.cost < best.place.cost:
            best = found
        if misfit(best) < comparison.explained_below:
            break
    if best is None:
        raise ValueError("no chain near the nominal one moves through any window: the nominal lumps are no chain's")
    return _estimate(comparison, best, iterations, starts)


def grow(comparison: Comparison, point: Array) -> Descent | None:
    """The descent from a `point`, on the shortest windows first; None where the twin cannot follow from there.

    From one stage to the next, windows grow by `comparison.stride`. A descent that does not explain what it was led to
    may have left the valley of the truth. So it is begun again from where the last one ended, with windows that grow by
    half as much.
    """
    iterations, reached, stride, explained = 0, 0, comparison.stride, True
    while reached < comparison.stages:
        windows = min(reached + stride, comparison.stages) if reached else 1
        found, valley = _descent(comparison, point, windows), explained
        iterations += 0 if found is None else found.iterations
        explained = found is not None and misfit(found) < IN_THE_VALLEY
        if valley and not explained and reached and stride > 1:
            explained, stride = True, stride // 2
            continue
        if found is None:
            return None
        stride = min(2 * stride, comparison.stride) if explained else comparison.stride
        point, reached = found.place.point, windows
    assert found is not None, "there is a window"
    return Descent(found.place, iterations, found.converged)


def _descent(comparison: Comparison, point: Array, windows: int) -> Descent | None:
    """That from a `point` on the first `windows` windows; None where the twin cannot follow from there."""
    place = place_at(comparison, point, windows)
    if place is None:
        return None
    limits = (ROUGHLY, MOST_ROUGH) if windows < comparison.stages else (EXACTLY, MOST_EXACT)
    return descend(comparison, place, windows, *limits)


def misfit(found: Descent) -> float:
    """Root mean square of the residuals, in units of what noise or rounding explains."""
    residuals = found.place.residuals
    return float(np.sqrt(2.0 * residuals.cost / residuals.count))


def starting_points(comparison: Fitted, start: Array | None, restarts: int, seed: int) -> Iterator[Array]:
    """The `start` if there is one, the nominal model, and random points about it.

    Args:
        comparison: what is fitted, with the prior of its unknowns.
        start: log factors (nunknown) to try first.
        restarts: how many random points.
        seed: of these.
    """
    spreads = comparison.spreads
    if start is not None:
        yield start
    yield np.zeros(len(spreads))
    random = np.random.default_rng(seed)
    for _ in range(restarts):
        point = spreads * random.standard_normal(len(spreads))
        for _ in range(DRAWS):  # independent factors of many lumps are often no chain's: M must be positive definite
            if comparison.residuals(np.append(point, np.zeros(comparison.extras)), 1) is not None:
                yield point
                break
            point = NARROWER * point


def _estimate(comparison: Comparison, found: Descent, iterations: int, starts: int) -> Estimate:
    place, unknowns = found.place, comparison.unknowns
    factor, _ = triangle(place, comparison.spreads)
    inverse = np.linalg.inv(factor)
    log_factors = place.point[: len(unknowns.names)]
    return Estimate(
        names=tuple(unknowns.names),
        lumps=unknowns.lumps(log_factors),
        log_factors=log_factors,
        covariance=inverse @ inverse.T,  # Eq. 27; R is the factor of what is inverted
        cost=place.cost,
        misfit=misfit(found),
        explained_below=comparison.explained_below,
        iterations=iterations,
        starts=starts,
        converged=found.converged,
        residuals=comparison.by_joint(place.point),
        extras=place.point[len(log_factors) :],
    )
