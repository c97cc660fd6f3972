"""What a study can determine and what it cannot, from its nominal model alone, before any trial.

The nominal model is taken for the truth. The question is which other factors the study's measure cannot tell from it.
For `spectral` and `smoothed` the sensitivity H answers for all lumps together (Eqs. 11 and 14). `count` and `crossing`
have no such form. For them one factor at a time is moved away from 1, until the measure notices or a bound is met. A
study that stands by its estimate, or that measures frequencies and has an estimate, is tried on the nominal model, and
the covariance of the estimate answers.

The noise of the plant counts: it moves the measure from one episode with exact lumps to the next, and a difference that
is smaller than that cannot be seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from metaid.episode import NOISE_RESOLUTION, pushes_for
from metaid.models import COARSEST, DEVIATIONS, Array, lump_names
from metaid.plant import PlantSettings
from metaid.search import Searcher
from metaid.study.experiments import spread_of_pushes
from metaid.study.problem import Problem

if TYPE_CHECKING:
    from metaid.compiled import Objective
    from metaid.estimation import Experiment

NEGLIGIBLE = 0.02  # weight of a lump in a combination, of 1
# Factors of the gravity lumps in the first trials of an estimate, as many as it needs; those of others are between.
OVER_COMPENSATED = (1.5, 2.0)
OWN_NOISE = 1  # added to the study's seed: a rehearsal has other noise than the study
EPISODES = 32  # with exact lumps, which show how far noise moves the measure
HALVINGS = 11  # of the interval in which a factor stops being noticed


@dataclass(frozen=True)
class Identifiability:
    """By lump `names`: the `resolution` (nlump) with which its factor can be found, as a fraction; inf if not at all.

    `combinations`: changes of the factors, by lump name, that the measure does not notice at all or hardly; largest
    first. `low` and `high`: the least and largest lumps (nlump) that the bounds allow, in their units; a search finds
    none beyond. An estimate does, so for it they are 0 and infinite.
    """

    names: tuple[str, ...]
    resolution: Array
    low: Array
    high: Array
    combinations: tuple[dict[str, float], ...] = ()

    @property
    def determined(self) -> list[bool]:
        """Whether each lump can be found to better than a tenth."""
        return [bool(value <= COARSEST) for value in self.resolution]

    @property
    def undetermined_names(self) -> list[str]:
        """The lumps that cannot."""
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
    nominal = problem.lumps.vector
    return nominal * problem.low, nominal * problem.high


def _from_sensitivity(problem: Problem) -> Identifiability:
    """Half the width of the ellipsoid δᵀ H δ = (2π resolution)² along each lump.  Eq. 14."""
    resolution = max(problem.resolution, _noise_resolution(problem))
    h = problem.sensitivity()
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
    settings = problem.spec.plant
    if not isinstance(settings, PlantSettings) or not settings.faults.is_noisy:
        return 0.0
    objective, exact = _nominal_objective(problem), np.ones(len(problem.names))
    outcomes = [objective.evaluate(exact, number) for number in range(EPISODES)]
    if any(outcome.fell for outcome in outcomes):
        return np.inf
    values = np.array([outcome.value for outcome in outcomes])
    return NOISE_RESOLUTION * float(np.sqrt(np.std(np.sign(values) * values**2)))


def _from_estimate(problem: Problem) -> Identifiability:
    """Half the 95 % interval of each lump by the estimate from trials on the nominal model: as many that
    over-compensate as it needs, and, but for counts, one at the truth. The start speeds are the study's, so the
    impulses are others.
    """
    pushes = pushes_for(problem.nominal_plant(), problem.start_speeds)
    experiment, objective = _nominal_experiment(problem, pushes), _nominal_objective(problem, pushes)
    assert experiment is not None
    nlink, random = problem.nominal.nlink, np.random.default_rng(problem.spec.study.seed)
    laws = np.ones((experiment.probes + 1, len(problem.names)))  # the last is the truth
    for law, factor in enumerate(OVER_COMPENSATED[: experiment.probes]):
        laws[law, :nlink] = factor
    laws[len(OVER_COMPENSATED) : -1, :nlink] = random.uniform(*OVER_COMPENSATED, laws[2:-1, :nlink].shape)
    if problem.spec.study.estimate.compare == "count":
        laws = laws[:-1]  # a plant that coasts shows no count
    trials = [experiment.trial(factors, objective.evaluate(factors, number)) for number, factors in enumerate(laws)]
    estimate = experiment.estimate([trial for trial in trials if trial is not None])
    names = lump_names(problem.nominal.nlink, problem.estimated_kinds)
    unbounded = np.zeros(len(names)), np.full(len(names), np.inf)
    if estimate is None:
        return Identifiability(tuple(names), np.full(len(names), np.inf), *unbounded)
    return Identifiability(tuple(names), DEVIATIONS * estimate.lump_deviations, *unbounded)


def chain_rehearsal(problem: Problem) -> tuple[Searcher, Objective]:
    """The searcher and the objective of a study if its nominal model were the truth, pushed to the study's start
    speeds.
    """
    pushes = pushes_for(problem.nominal_plant(), problem.start_speeds)
    searcher = problem.make_searcher(partial(_nominal_experiment, problem, pushes))
    return searcher, _nominal_objective(problem, pushes, OWN_NOISE)


def _nominal_objective(problem: Problem, pushes: Array | None = None, further: int = 0) -> Objective:
    """What the study would evaluate its candidates with if its nominal model were the truth; with the study's impulses,
    or with these `pushes` (npush x njoint), in N s. `further` is added to the seed of the noise.
    """
    from metaid.compiled import Objective  # loads MuJoCo and numba, which other measures do without

    rule, episode = problem.spec.study.episode.rule, replace(problem.episode, calibration=None)
    episode = replace(episode, seed=episode.seed + further)
    if pushes is not None:
        episode = replace(episode, pushes=pushes)
    return Objective(problem.nominal_plant(), problem.lumps, episode, problem.measure.name, rule=rule)


def _nominal_experiment(problem: Problem, pushes: Array) -> Experiment | None:
    """What an estimate would need to know if the nominal model were the truth: impulses that differ give it other
    speeds than the plant. `pushes` (npush x njoint) in N s.
    """
    experiment = problem.experiment()
    if experiment is not None and experiment.loop is not None and isinstance(problem.spec.plant, PlantSettings):
        spread = spread_of_pushes(problem.nominal_plant(), pushes)
        return replace(experiment, loop=replace(experiment.loop, start_spread=spread))
    return experiment


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
        return outcome.fell or outcome.value > unnoticed

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
