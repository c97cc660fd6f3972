"""The samplers by name. One more sampler is one more entry here; its options are a class in its own module."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import optuna

from metaid.errors import StudyError, unknown
from metaid.search.cmaes import Cmaes
from metaid.search.coordinates import Coordinates
from metaid.search.dinoip import Dinoip, DinoipOptions
from metaid.search.newton import Newton
from metaid.search.optuna_samplers import OptunaSampler
from metaid.search.searcher import Searcher, StepOptions


class SamplerOptions(StepOptions, DinoipOptions):
    """The options of all samplers, as keys of `[search]` in a study file; each sampler takes its own."""


@dataclass(frozen=True)
class Sampler:
    """How a sampler's searcher is made, from coordinates, the study's seed and the options.

    More trials than `advised_trials` are advised against: each takes longer than the one before.
    """

    make: Callable[[Coordinates, int, SamplerOptions], Searcher]
    advised_trials: int | None = None


def _tpe(seed: int) -> optuna.samplers.BaseSampler:
    return optuna.samplers.TPESampler(seed=seed, multivariate=True, constant_liar=True)


def _optuna_cmaes(seed: int) -> optuna.samplers.BaseSampler:
    return optuna.samplers.CmaEsSampler(seed=seed, consider_pruned_trials=True, warn_independent_sampling=False)


def _random(seed: int) -> optuna.samplers.BaseSampler:
    return optuna.samplers.RandomSampler(seed=seed)


SAMPLERS = {
    "cmaes": Sampler(lambda coordinates, seed, options: Cmaes(coordinates, seed, options)),
    "newton": Sampler(lambda coordinates, seed, options: Newton(coordinates, seed, options)),
    "tpe": Sampler(lambda coordinates, seed, options: OptunaSampler(coordinates, _tpe, seed, options), 2000),
    "random": Sampler(lambda coordinates, seed, options: OptunaSampler(coordinates, _random, seed, options)),
    "optuna-cmaes": Sampler(
        lambda coordinates, seed, options: OptunaSampler(coordinates, _optuna_cmaes, seed, options)
    ),
    "dinoip": Sampler(lambda coordinates, seed, options: Dinoip(coordinates, options)),
}


def make_searcher(sampler: str, coordinates: Coordinates, seed: int, options: SamplerOptions) -> Searcher:
    """A searcher by the name of its sampler.

    Args:
        sampler: a key of `SAMPLERS`.
        coordinates: what the searcher moves in.
        seed: of all that it draws at random.
        options: of all samplers; it takes its own.

    Raises:
        StudyError: there is no such sampler, or it cannot work with these coordinates or options.
    """
    if sampler not in SAMPLERS:
        raise StudyError(unknown("sampler", sampler, SAMPLERS))
    return SAMPLERS[sampler].make(coordinates, seed, options)
