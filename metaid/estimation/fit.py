"""The fit of the twin to what all trials of a study showed: from the shortest windows to the longest, and once more
from elsewhere where it ends in a wrong minimum.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, ClassVar, Protocol

import numpy as np

from metaid.estimation.descent import Descent, Fitted, covariance_at, descend, place_at
from metaid.estimation.faults import SearchedFaults, found_faults
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array

ROUGHLY, EXACTLY = 1e-2, 1e-10  # the last step in an unknown: on windows that are to grow, and on all of them
MOST_ROUGH, MOST_EXACT = 30, 100  # steps: on windows that are to grow, and on all of them
MOST_ALONE, MOST_EXPLAINING = 25, 8  # likewise: from where another fit ended, few are enough
IN_THE_VALLEY = 3.0  # a misfit below this, on windows that are to grow, is not that of a wrong minimum
HOPELESS = 1.5  # of what noise explains: a misfit above this on short windows is not below it on longer ones
NARROWER = 0.7  # of the spread about a start that no chain can have, for the next start
DRAWS = 20


class Growing(Fitted, Protocol):
    """What is compared with a twin, on windows that grow by `stride` at once, a power of two: motions of a plant
    without noise, or `Readings` of noisy sensors.
    """

    stride: ClassVar[int]

    @property
    def unknowns(self) -> Unknowns:
        """What is unknown of the robot."""

    @property
    def faults(self) -> SearchedFaults:
        """The faults that are unknown beside them."""

    @property
    def rough_stages(self) -> int:
        """How many of the first stages lead on to longer windows, so that a rough fit is enough."""

    @property
    def least_gain(self) -> float:
        """Of cost; a step that promises less is not made."""

    @property
    def explained_below(self) -> float:
        """A misfit below this says that the model explains what was seen."""

    def by_joint(self, point: Array, /) -> tuple[Array, ...]:
        """Root mean square of the residuals of each trial (npush x njoint) at a `point`."""


def fit(
    comparison: Growing,
    start: Array | None = None,
    restarts: int = 3,
    refines: bool = False,
    explains: bool = False,
) -> Any:
    """The robot that all trials of a `comparison` lead to, a `Found`; None where the twin cannot follow the trials from
    any start, or explains them from none though it is to.

    Args:
        comparison: what is compared with the twin.
        start: unknowns of the robot, with faults behind them (nunknown), to try before the nominal model, such as
            those of the estimate before, and perhaps those that concern one push alone (nextra); None for where fits to
            such a robot begin.
        restarts: how often the fit may begin at a random point of the prior, where the misfit says that it ended in a
            wrong minimum.
        refines: whether all windows are compared from the `start` on, where that is in the valley of the truth.
        explains: whether a fit is wanted only where it explains what was seen: then what will not is given up early.
    """
    found = _refined(comparison, start) if refines and start is not None else None
    found = found or _found(comparison, begun(comparison, start), restarts, explains)
    if found is None:
        return None
    place, robot = found.place, comparison.unknowns
    covariance, count = covariance_at(place, comparison.spreads), len(robot.names)  # Eq. 27
    return robot.estimated(
        names=tuple(robot.names),
        unknowns=place.point[:count],
        covariance=covariance[:count, :count],
        cost=place.cost,
        misfit=place.residuals.misfit,
        explained_below=comparison.explained_below,
        iterations=found.iterations,
        residuals=comparison.by_joint(place.point),
        extras=place.point[len(covariance) :],
        faults=found_faults(comparison.faults, place.point, covariance),
    )


def begun(comparison: Growing, start: Array | None) -> Array | None:
    """Where a fit begins (nunknown): at the `start` if there is one, else where fits to such a robot do, without
    faults; None for the nominal model.
    """
    begin = comparison.unknowns.begin if start is None else None
    return start if begin is None else np.append(begin, np.zeros(len(comparison.faults.names)))


def _found(comparison: Growing, start: Array | None, restarts: int, explains: bool) -> Descent | None:
    """The lowest descent from all starts; see `fit`. None where the twin cannot follow from any of them."""
    best: Descent | None = None
    iterations = 0
    for point in starting_points(comparison, start, restarts):
        most = MOST_EXACT if restarts >= 0 else MOST_EXPLAINING if explains else MOST_ALONE
        found = _grow(comparison, _whole(comparison, point), most, explains)
        if found is None:
            continue
        iterations += found.iterations
        if best is None or found.place.cost < best.place.cost:
            best = found
        if best.place.residuals.misfit < comparison.explained_below:
            break
    return None if best is None else replace(best, iterations=iterations)


def _refined(comparison: Growing, start: Array) -> Descent | None:
    """The descent on all windows at once from a `start` (nunknown) in the valley of the truth; None if it is not there.

    The estimate from the trials before is such a start, where these were explained: windows need not grow again.
    """
    found = _descent(comparison, _whole(comparison, start), comparison.stages)
    return found if found is not None and found.place.residuals.misfit < comparison.explained_below else None


def settled(comparison: Growing, point: Array) -> Array | None:
    """The unknowns (nunknown) where a descent on all windows at once ends that begins at a `point` (nunknown + nextra),
    whatever it explains; None where the twin cannot follow from there.
    """
    found = _descent(comparison, point, comparison.stages)
    return None if found is None else found.place.point[: len(comparison.spreads)]


def _grow(comparison: Growing, point: Array, most: int, explains: bool) -> Descent | None:
    """The descent from a `point`, on the shortest windows first; None where the twin cannot follow from there.

    From one stage to the next, windows grow by `comparison.stride`. A descent that does not explain what it was led to
    may have left the valley of the truth. So it is begun again from where the last one ended, with windows that grow by
    half as much.

    Args:
        comparison: what is compared with the twin.
        point: all unknowns (nunknown + nextra) to begin with.
        most: steps, on all windows at once.
        explains: whether it is wanted only where it explains what was seen: None as soon as it will not.
    """
    iterations, reached, stride, explained = 0, 0, comparison.stride, True
    while reached < comparison.stages:
        windows = min(reached + stride, comparison.stages) if reached else 1
        found, valley = _descent(comparison, point, windows, most), explained
        iterations += 0 if found is None else found.iterations
        if explains:
            if found is None or found.place.residuals.misfit > HOPELESS * comparison.explained_below:
                return None
            if windows == comparison.stages and not found.converged:
                found = _descent(comparison, found.place.point, windows) or found
        explained = found is not None and found.place.residuals.misfit < IN_THE_VALLEY
        if valley and not explained and reached and windows > reached + 1:
            explained = True
            while stride >= windows - reached:  # what remains may be less than a stride
                stride //= 2
            continue
        if found is None:
            return None
        stride = min(2 * stride, comparison.stride) if explained else comparison.stride
        point, reached = found.place.point, windows
    assert found is not None, "there is a window"
    return Descent(found.place, iterations, found.converged)


def _descent(comparison: Growing, point: Array, windows: int, most: int = MOST_EXACT) -> Descent | None:
    """That from a `point` on the first `windows` windows, roughly where these are to grow; None where the twin cannot
    follow from there.
    """
    place = place_at(comparison, point, windows)
    if place is None:
        return None
    grows = windows <= comparison.rough_stages
    tolerance, most = (ROUGHLY, MOST_ROUGH) if grows else (EXACTLY, most)
    ends_when_cut, least_gain = comparison.unknowns.ends_when_cut, comparison.least_gain
    return descend(comparison, place, windows, tolerance, most, ends_when_cut, least_gain)


def starting_points(comparison: Fitted, start: Array | None, restarts: int) -> Iterator[Array]:
    """The `start` (nunknown) if there is one, the nominal model, and so many random points about it, the same each
    time; a `start` alone where `restarts` is below 0.
    """
    spreads = comparison.spreads
    if start is not None:
        yield start
    if start is None or restarts >= 0:
        yield np.zeros(len(spreads))
    random = np.random.default_rng(0)
    for _ in range(restarts):
        point = spreads * random.standard_normal(len(spreads))
        for _ in range(DRAWS):  # independent factors of many lumps are often no chain's: M must be positive definite
            if comparison.residuals(np.append(point, np.zeros(comparison.extras)), 1) is not None:
                yield point
                break
            point = NARROWER * point


def _whole(comparison: Fitted, point: Array) -> Array:
    """All unknowns (nunknown + nextra) of a `point`, those 0 that it lacks at its end."""
    return np.append(point, np.zeros(len(comparison.spreads) + comparison.extras - len(point)))
