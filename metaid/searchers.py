"""Who proposes candidates: ask for a generation, tell what became of it. The same interface for every sampler.

A generation's size belongs to the study, not to the number of workers, so the trials are the same whoever evaluates
them.
Falls carry values above every survivor's (Eq. 13); searchers that can be told of a fall as such are.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import cmaes
import numpy as np
import optuna

from metaid.chain import Array
from metaid.coordinates import Coordinates
from metaid.dinoip import Dinoip
from metaid.errors import StudyError, unknown
from metaid.newton import Newton
from metaid.objective import Outcome

RESAMPLINGS = 100  # of a candidate that leaves the bounds, before it is moved to the nearest one
BATCH = 8  # candidates that an Optuna sampler proposes before it is told of any


@dataclass(frozen=True)
class SearchOptions:
    """What a study says to its searcher, which takes what concerns it: the first step `sigma` in the coordinates' own
    unit, the generation size (default: the sampler's own), the `increment` of factors that dinoip steps by, and
    whether it goes coarse to fine.
    """

    sigma: float = 0.2
    generation_size: int | None = None
    increment: float = 0.01
    coarse_to_fine: bool = False


class Searcher(Protocol):
    """Proposes factors and learns from outcomes, generation by generation."""

    @property
    def spread(self) -> float | None:
        """How widely it still looks about, in its own coordinates; None where it has no such number."""

    def ask(self) -> Array:
        """The next generation's factors (ncandidate x nlump)."""

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        """What became of them, in the same order."""

    def finished(self) -> bool:
        """Whether it cannot improve any more."""


class Cmaes:
    """CMA-ES of the cmaes package, in the given coordinates; candidates beyond the bounds are drawn again."""

    def __init__(self, coordinates: Coordinates, seed: int, sigma: float, generation_size: int | None) -> None:
        self._coordinates = coordinates
        mean = np.zeros(len(coordinates.origin))
        self._optimizer = cmaes.CMA(mean=mean, sigma=sigma, seed=seed, population_size=generation_size)
        self._asked: list[Array] = []

    @property
    def spread(self) -> float | None:
        return float(self._optimizer._sigma)

    def ask(self) -> Array:
        self._asked = [self._candidate() for _ in range(self._optimizer.population_size)]
        return np.array([self._coordinates.factors(z) for z in self._asked])

    def _candidate(self) -> Array:
        for _ in range(RESAMPLINGS):
            z: Array = self._optimizer.ask()
            if self._coordinates.inside(z):
                return z
        return self._coordinates.z(self._coordinates.factors(z))

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        self._optimizer.tell([(z, outcome.value) for z, outcome in zip(self._asked, outcomes, strict=True)])

    def finished(self) -> bool:
        return bool(self._optimizer.should_stop())


class OptunaSampler:
    """Any Optuna sampler, on a study in memory; falls are pruned trials with the step that they survived to."""

    def __init__(
        self, coordinates: Coordinates, sampler: optuna.samplers.BaseSampler, generation_size: int | None
    ) -> None:
        self._coordinates = coordinates
        self._size = generation_size or BATCH
        self._study = optuna.create_study(sampler=sampler, direction="minimize")
        low, high = coordinates.box()
        self._space: dict[str, optuna.distributions.BaseDistribution] = {
            f"z_{i}": optuna.distributions.FloatDistribution(low[i], high[i]) for i in range(len(low))
        }
        self._asked: list[optuna.Trial] = []

    @property
    def spread(self) -> float | None:
        return None

    def ask(self) -> Array:
        self._asked = [self._study.ask(self._space) for _ in range(self._size)]
        return np.array(
            [self._coordinates.factors(np.array([trial.params[key] for key in self._space])) for trial in self._asked]
        )

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        for trial, outcome in zip(self._asked, outcomes, strict=True):
            trial.report(outcome.value, step=outcome.steps)
            if outcome.fell:
                self._study.tell(trial, state=optuna.trial.TrialState.PRUNED)
            else:
                self._study.tell(trial, outcome.value)

    def finished(self) -> bool:
        return False


MakeSearcher = Callable[[Coordinates, int, SearchOptions], Searcher]


def _optuna(make: Callable[[int], optuna.samplers.BaseSampler]) -> MakeSearcher:
    def searcher(coordinates: Coordinates, seed: int, options: SearchOptions) -> Searcher:
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            return OptunaSampler(coordinates, make(seed), options.generation_size)

    return searcher


SAMPLERS: dict[str, MakeSearcher] = {
    "cmaes": lambda coordinates, seed, options: Cmaes(coordinates, seed, options.sigma, options.generation_size),
    "newton": lambda coordinates, seed, options: Newton(coordinates, seed, options.sigma, options.generation_size),
    "tpe": _optuna(lambda seed: optuna.samplers.TPESampler(seed=seed, multivariate=True, constant_liar=True)),
    "random": _optuna(lambda seed: optuna.samplers.RandomSampler(seed=seed)),
    "optuna-cmaes": _optuna(
        lambda seed: optuna.samplers.CmaEsSampler(
            seed=seed, consider_pruned_trials=True, warn_independent_sampling=False
        )
    ),
    "dinoip": lambda coordinates, seed, options: Dinoip(coordinates, options.increment, options.coarse_to_fine),
}


def make_searcher(sampler: str, coordinates: Coordinates, seed: int, options: SearchOptions) -> Searcher:
    """A searcher by name.  Raises StudyError, naming the allowed ones."""
    if sampler not in SAMPLERS:
        raise StudyError(unknown("sampler", sampler, SAMPLERS))
    return SAMPLERS[sampler](coordinates, seed, options)
