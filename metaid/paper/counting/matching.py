"""The search for a model with exactly the counts that were seen, and the extent of the set of such models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from metaid.estimation import FARTHEST, Estimate, Experiment, WatchedTrial, descend, place_at, starting_points
from metaid.models import DEVIATIONS, Array
from metaid.paper.counting.counts import Counted, Counts
from metaid.paper.counting.programme import pairs, sides

STAGES = 9  # growing horizons of the first descent
ROUGHLY, FINELY = 1e-2, 1e-4  # the last step in a log factor of the two descents
MOST_ROUGH, MOST_FINE = 6, 30  # their steps on one horizon
REACH, LONGEST_REACH, SHORTEST_REACH = 0.03, 0.3, 1e-6  # of a linear programme in each log factor
MARGIN = 1e-4  # by which inequalities are to hold, so that rounding does not matter
PROGRAMMES = 30
POOR, GOOD = 0.3, 0.7  # shares of the promised gain, below and above which the next programme reaches less or more
SHARES = 1.0, 0.5, 0.25, 0.1  # of the way to the centre of the set, until the counts there are right
RIGHT_COUNTS = 1.0  # fewer counts than this differ where the model shows what was counted
PROBES = 10  # trials that over-compensate: a count says little


@dataclass(frozen=True)
class Model:
    """Log factors (nunknown), what is counted there, and by how much it is `wrong`."""

    log_factors: Array
    counted: Counted
    wrong: float


def match_counts(counts: Counts, start: Array | None = None, restarts: int = 3) -> Estimate:
    """The centre of the set of models that show exactly the counts that were seen, and its extent.

    Args:
        counts: of all trials.
        start: log factors (nunknown) to try before the nominal model, such as those of the estimate before.
        restarts: how often the search may begin at a random point of the prior, where it ended with wrong counts.

    Returns:
        An estimate whose misfit is the number of counts that differ. Its extent is of all models that have every joint
        on the right side of the upright at the end of every window, to first order; the exact ones are among them.

    Raises:
        ValueError: the twin cannot follow the trials from any start.
    """
    best: Model | None = None
    steps = 0
    for point in starting_points(counts, start, restarts):
        model, taken = _search(counts, point)
        if model is None:
            continue
        steps += taken
        if best is None or (model.counted.differing, model.wrong) < (best.counted.differing, best.wrong):
            best = model
        if not model.counted.differing:
            break
    if best is None:
        raise ValueError("no chain near the nominal one moves through any window: the nominal lumps are no chain's")
    return _estimate(counts, best if best.counted.differing else _centred(counts, best), steps)


def _search(counts: Counts, point: Array) -> tuple[Model | None, int]:
    """The best model from a `point`, and how many steps it took; no model where the twin cannot follow.

    Phases lead to within some percent, on growing horizons (Eq. 29); then sides, which no lost pair of crossings moves;
    then linear programmes to the last count.
    """
    steps = 0
    horizons = np.unique(np.geomspace(1, counts.stages, STAGES).round().astype(int)).tolist()
    descents = [(counts, windows, ROUGHLY, MOST_ROUGH) for windows in horizons]
    descents.append((replace(counts, by_side=True), counts.stages, FINELY, MOST_FINE))
    for compared, windows, tolerance, most in descents:
        place = place_at(compared, point, windows)
        if place is None:
            return None, steps
        found = descend(compared, place, windows, tolerance, most)
        point, steps = found.place.point, steps + found.iterations
    return _exact(counts, point), steps


def _exact(counts: Counts, point: Array) -> Model | None:
    """The model that linear programmes lead to from a `point`, each about the last, until all counts are right."""
    model, reach = _model(counts, point), REACH
    for _ in range(PROGRAMMES):
        if model is None or not model.counted.differing or reach < SHORTEST_REACH:
            break
        solved = pairs(model.counted, MARGIN).nearest(reach)
        if solved is None:
            break
        step, promised = solved
        new = _model(counts, model.log_factors + step)
        share = -1.0 if new is None else (model.wrong - new.wrong) / max(model.wrong - promised, 1e-12)
        if new is not None and (share > 0.0 or new.counted.differing < model.counted.differing):
            model = new
            reach = min(2.0 * reach, LONGEST_REACH) if share > GOOD else 0.5 * reach if share < POOR else reach
        else:
            reach = POOR * min(reach, float(np.abs(step).max()))
    return model


def _model(counts: Counts, log_factors: Array) -> Model | None:
    """The model there; None where it is too far from the nominal one or the twin cannot follow."""
    if not float(np.abs(log_factors / counts.spreads).max()) <= FARTHEST:
        return None
    counted = counts.counted(log_factors, counts.stages)
    return None if counted is None else Model(log_factors, counted, pairs(counted, MARGIN).violation)


def _centred(counts: Counts, model: Model) -> Model:
    """A model with right counts that is as far as can be from any that has a wrong one."""
    step = pairs(model.counted).deepest()
    if step is not None:
        for share in SHARES:
            new = _model(counts, model.log_factors + share * step)
            if new is not None and not new.counted.differing:
                return new
    return model


def _estimate(counts: Counts, model: Model, steps: int) -> Estimate:
    log_factors, unknowns = model.log_factors, counts.unknowns
    covariance, extent, directions = np.diag(counts.spreads**2), None, np.eye(len(log_factors))
    if not model.counted.differing:
        inside = sides(model.counted)
        extremes, of_lumps = inside.extremes(directions), inside.extremes(unknowns.design)
        if extremes is not None and of_lumps is not None:
            extent = unknowns.design @ log_factors + np.einsum("ekp,kp->ek", of_lumps, unknowns.design)
            covariance = _covariance(extremes)
    return Estimate(
        names=tuple(unknowns.names),
        searched=unknowns,
        unknowns=log_factors,
        covariance=covariance,
        cost=model.wrong,
        misfit=float(model.counted.differing),
        explained_below=RIGHT_COUNTS,
        iterations=steps,
        residuals=counts.by_joint(log_factors),
        extras=np.empty(0),
        extent=extent,
        counts=len(model.counted.seen),
    )


def _covariance(extremes: Array) -> Array:
    """A covariance (nunknown x nunknown) with the correlations of the `extremes` of a set, and half its extents as so
    many standard DEVIATIONS.
    """
    halves = 0.5 * (np.diagonal(extremes[1]) - np.diagonal(extremes[0])) / DEVIATIONS
    moments = np.atleast_2d(np.cov(extremes.reshape(-1, len(halves)).T))
    scale = halves / np.sqrt(np.maximum(np.diag(moments), np.finfo(float).tiny))
    return np.asarray(moments * np.outer(scale, scale))


@dataclass(frozen=True, eq=False)
class CountedExperiment(Experiment):
    """That of a planar chain without noise: the half periods of each window are to be exactly those of the twin."""

    counts: ClassVar[bool] = True

    @property
    def probes(self) -> int:
        return PROBES

    def _comparison(self, trials: Sequence[WatchedTrial]) -> Counts:
        return Counts([trial for trial in trials if trial.windows.seen.any()], self.unknowns)

    def _fit(self, compared: Any, begin: Array | None, restarts: int) -> Estimate:
        return match_counts(compared, begin, restarts)
