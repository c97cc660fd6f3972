"""What a study can determine and what it cannot, from its nominal model alone, before any trial.

The nominal model is taken for the truth. The question is which other factors the study's measure cannot tell from it.
For `spectral` and `smoothed` the sensitivity H answers for all lumps together (Eqs. 15 and 17). `count` and `crossing`
have no such form. For them one factor at a time is moved away from 1, until the measure notices or a bound is met. A
study that stands by its estimate, or that measures frequencies and has an estimate, is tried on the nominal model, and
the covariance of the estimate answers.

The noise of the plant counts: it moves the measure from one episode with exact lumps to the next, and a difference that
is smaller than that cannot be seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from metaid.episode import NOISE_RESOLUTION
from metaid.models import COARSEST, DEVIATIONS, Array
from metaid.study.problem import Problem

NEGLIGIBLE = 0.02  # weight of a lump in a combination, of 1
EPISODES = 32  # with exact lumps, which show how far noise moves the measure
HALVINGS = 11  # of the interval in which a factor stops being noticed


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What of each parameter can be determined, by `names`.

    Attributes:
        resolution: with which each lump can be found, as a fraction, or each base parameter, in its unit (n); inf if
            not at all.
        low: the least (n) that the bounds of lumps allow, in their units; a search finds none beyond. An estimate does,
            so for it they are 0 and infinite.
        high: the largest.
        scale: what a resolution is small beside: of a base parameter how well it is known beforehand.
        combinations: changes of the factors, by lump name, that the measure does not notice at all or hardly; largest
            first.
        shown_by: which pushes of an arm show each, "coasts" or "springs" alone; None of a chain.
    """

    names: tuple[str, ...]
    resolution: Array
    low: Array
    high: Array
    scale: Array | float = 1.0
    combinations: tuple[dict[str, float], ...] = ()
    shown_by: tuple[str, ...] | None = None

    @property
    def determined(self) -> list[bool]:
        """Whether each can be found to better than a tenth."""
        found: list[bool] = (self.resolution <= COARSEST * self.scale).tolist()
        return found

    @property
    def undetermined_names(self) -> list[str]:
        """Those that cannot."""
        return [name for name, found in zip(self.names, self.determined, strict=True) if not found]


def identifiability(problem: Problem) -> Identifiability:
    """What a study can determine, if its nominal model were the truth: the estimate where that is its result, else the
    measure.
    """
    return _from_estimate(problem) if problem.is_told_by_estimate else identifiability_by_measure(problem)


def identifiability_by_measure(problem: Problem) -> Identifiability:
    """What the measure and the pushes of a study can determine of the lumps that it searches, if its nominal model were
    the truth.
    """
    if problem.measure.sees_coriolis:
        return _from_sensitivity(problem)
    return Identifiability(tuple(problem.names), _one_by_one(problem), *_allowed(problem))


def _allowed(problem: Problem) -> tuple[Array, Array]:
    """The least and the largest lumps (nlump) within the bounds, in their units."""
    nominal = problem.chain.lumps.vector
    return nominal * problem.low, nominal * problem.high


def _from_sensitivity(problem: Problem) -> Identifiability:
    """Half the width of the ellipsoid δᵀ H δ = (2π resolution)² along each lump.  Eq. 17."""
    resolution = max(problem.resolution, _noise_resolution(problem))
    h = problem.robot.sensitivity()
    values, vectors = np.linalg.eigh(h)
    seen = values > len(values) * np.finfo(float).eps * values[-1]
    widths = np.full(len(values), np.inf)
    widths[seen] = 2.0 * np.pi * resolution / np.sqrt(values[seen])
    weights = np.where(np.abs(vectors) > NEGLIGIBLE, vectors, 0.0)
    along = np.multiply(np.abs(weights), widths, out=np.zeros(h.shape), where=weights != 0.0)
    combinations = tuple(
        {problem.names[lump]: float(weight) for lump, weight in enumerate(weights[:, i]) if weight != 0.0}
        for i in np.flatnonzero(widths > COARSEST)
    )
    return Identifiability(
        tuple(problem.names), np.sqrt((along**2).sum(axis=1)), *_allowed(problem), combinations=combinations
    )


def _noise_resolution(problem: Problem) -> float:
    """How far two values of the measure must be apart to be told apart in spite of the plant's noise, in Hz; 0 where
    there is none.

    It is the same multiple of the deviation from one episode to another that `smoothed` takes of a plant at rest. Here
    the nominal model moves, so pushes and torques count, too.
    """
    if not problem.spec.faults.is_noisy:
        return 0.0
    objective, exact = _nominal_objective(problem), np.ones(len(problem.names))
    outcomes = [objective.evaluate(exact, number) for number in range(EPISODES)]
    if any(outcome.fell for outcome in outcomes):
        return np.inf
    values = np.array([outcome.value for outcome in outcomes])
    return NOISE_RESOLUTION * float(np.sqrt(np.std(np.sign(values) * values**2)))


def _from_estimate(problem: Problem) -> Identifiability:
    """Half the 95 % interval of each parameter by the estimate from as many trials of the nominal model as it needs."""
    robot, wanted = problem.robot, problem.robot.estimated
    experiment, objective = problem.rehearsal()
    candidates = robot.rehearsed(experiment.probes)
    with threadpool_limits(1):
        trials = [experiment.trial(each, objective.evaluate(each, number)) for number, each in enumerate(candidates)]
        estimate = experiment.estimate([trial for trial in trials if trial is not None])
    count = len(wanted.names)
    deviations = np.full(count, np.inf) if estimate is None else estimate.value_deviations / wanted.scale
    return Identifiability(
        names=wanted.names,
        resolution=DEVIATIONS * deviations,
        low=np.zeros(count),
        high=np.full(count, np.inf),
        scale=1.0 if wanted.deviations is None else DEVIATIONS * wanted.deviations,
        shown_by=robot.shown_by,
    )


def _nominal_objective(problem: Problem) -> Any:
    """What the study would evaluate its candidates with if its nominal chain were the truth."""
    return problem.objective_on(problem.robot.nominal_plant(), replace(problem.episode, calibration=None))


def _one_by_one(problem: Problem) -> Array:
    """The largest change (nlump) of each factor alone, within its bounds, that the measure does not tell from none; inf
    where it does not notice a bound.
    """
    objective = _nominal_objective(problem)
    exact = np.ones(len(problem.names))
    unnoticed = objective.evaluate(exact).value + problem.resolution

    def noticed(lump: int, factor: float) -> bool:
        factors = exact.copy()
        factors[lump] = factor
        outcome = objective.evaluate(factors)
        return bool(outcome.fell or outcome.value > unnoticed)

    def farthest(lump: int, bound: float) -> float:
        """The distance from 1 towards the bound up to which nothing is noticed, inf if that is the bound."""
        if not noticed(lump, bound):
            return np.inf
        near, far = 0.0, bound - 1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (near + far)
            near, far = (near, middle) if noticed(lump, 1.0 + middle) else (middle, far)
        return abs(far)

    # Where a bound is 1, or 1 is out of bounds, there is no room on that side.
    below = [farthest(lump, low) if low < 1.0 else 0.0 for lump, low in enumerate(problem.low)]
    above = [farthest(lump, high) if high > 1.0 else 0.0 for lump, high in enumerate(problem.high)]
    return np.maximum(below, above)
