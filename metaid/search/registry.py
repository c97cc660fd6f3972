"""The samplers by name. One more sampler is one more entry here; its options are a class in its own module."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from optuna.samplers import CmaEsSampler, RandomSampler

from metaid.errors import StudyError, unknown
from metaid.paper import Dinoip, DinoipOptions
from metaid.search.cmaes import Cmaes
from metaid.search.coordinates import Coordinates
from metaid.search.optuna_samplers import MetricSearcher, OptunaSampler, tpe_for_metric
from metaid.search.output_error import OutputError, OutputErrorOptions
from metaid.search.searcher import Searcher, StepOptions

if TYPE_CHECKING:
    from metaid.estimation import Experiment

TPE_GENERATION, RANDOM_GENERATION = 4, 8  # candidates that they propose before they get an outcome
DISTANCE = "distance to the truth"  # of the best trial, by its value

FindExperiment = Callable[[], "Experiment | None"]  # called only where one is needed: estimating loads numba


class SamplerOptions(StepOptions, DinoipOptions, OutputErrorOptions):
    """The options of all samplers, as keys of `[search]` in a study file; each sampler takes its own."""


@dataclass(frozen=True)
class Sampler:
    """How a sampler's searcher is made, from coordinates, the study's seed, the options, and a function that gives what
    an estimate needs to know of the study, None where none can be made.

    More trials than `advised_trials` are advised against: each takes longer than the one before. One that goes
    `by_estimate` sends the estimate from all trials so far; its best trial is no result where that explains nothing.
    `spread_name` is what the searcher's `spread` is. One that `widens` can go on within wider bounds.
    """

    make: Callable[[Coordinates, int, SamplerOptions, FindExperiment], Searcher]
    advised_trials: int | None = None
    by_estimate: bool = False
    widens: bool = False
    spread_name: str = "step size"


def _optuna_cmaes(coordinates: Coordinates, seed: int, options: SamplerOptions, _: FindExperiment) -> Searcher:
    # Half of what cmaes adds to 4 by itself: where the landscape is nearly round, small generations learn as much.
    size = options.generation or 4 + int(1.5 * np.log(len(coordinates.origin)))
    return MetricSearcher(coordinates, CmaEsSampler(seed=seed, popsize=size, warn_independent_sampling=False), size)


SAMPLERS = {
    "cmaes": Sampler(lambda coordinates, seed, options, _: Cmaes(coordinates, seed, options), widens=True),
    "tpe": Sampler(
        lambda coordinates, seed, options, _: MetricSearcher(
            coordinates, tpe_for_metric(seed), options.generation or TPE_GENERATION
        ),
        advised_trials=2000,
        spread_name=DISTANCE,
    ),
    "random": Sampler(
        lambda coordinates, seed, options, _: OptunaSampler(
            coordinates, RandomSampler(seed=seed), options.generation or RANDOM_GENERATION
        )
    ),
    "optuna-cmaes": Sampler(_optuna_cmaes, spread_name=DISTANCE),
    "output-error": Sampler(
        lambda coordinates, seed, options, find: OutputError(coordinates, seed, options, find()),
        by_estimate=True,
        widens=True,
        spread_name="largest deviation",
    ),
    "dinoip": Sampler(lambda coordinates, seed, options, _: Dinoip(coordinates.origin, coordinates.low, options)),
}


def make_searcher(
    sampler: str,
    coordinates: Coordinates,
    seed: int,
    options: SamplerOptions,
    find_experiment: FindExperiment = lambda: None,
) -> Searcher:
    """A searcher by the name of its sampler.

    Args:
        sampler: a key of `SAMPLERS`.
        coordinates: what the searcher moves in.
        seed: of all that it draws at random.
        options: of all samplers; it takes its own.
        find_experiment: gives what an estimate needs to know of the study, None where none can be made.

    Raises:
        StudyError: there is no such sampler, or it cannot work with these coordinates or options.
    """
    if sampler not in SAMPLERS:
        raise StudyError(unknown("sampler", sampler, SAMPLERS))
    return SAMPLERS[sampler].make(coordinates, seed, options, find_experiment)
