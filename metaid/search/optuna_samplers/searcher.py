"""Optuna's samplers as searchers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import optuna
from optuna.samplers import BaseSampler

from metaid.episode import Outcome
from metaid.models import Array
from metaid.search.coordinates import Coordinates
from metaid.search.optuna_samplers.metric import MetricSampler, candidate_space

CONVERGED = 1e-6  # distance to the truth, in factors of the least determined lump


class OptunaSampler:
    """Any Optuna `sampler`, on a study in memory, in the given `coordinates`, so many candidates a `generation`; falls
    are pruned trials with the step that they survived to.
    """

    def __init__(self, coordinates: Coordinates, sampler: BaseSampler, generation: int) -> None:
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._coordinates = coordinates
        self._size = generation
        self._study = optuna.create_study(sampler=sampler, direction="minimize")
        self._space = candidate_space([f"z_{i}" for i in range(len(coordinates.origin))], *coordinates.box())
        self._proposed: list[optuna.Trial] = []

    @property
    def spread(self) -> float | None:
        return None

    def ask(self) -> Array:
        self._proposed = [self._study.ask(self._space) for _ in range(self._size)]
        proposed = (np.array([trial.params[key] for key in self._space]) for trial in self._proposed)
        return np.array([self._factors(each) for each in proposed])

    def _factors(self, params: Array) -> Array:
        return self._coordinates.factors(params)

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        for trial, outcome in zip(self._proposed, outcomes, strict=True):
            trial.report(outcome.value, step=outcome.steps)
            if outcome.fell:
                self._study.tell(trial, state=optuna.trial.TrialState.PRUNED)
            else:
                self._study.tell(trial, outcome.value)

    def finished(self) -> bool:
        return False


class MetricSearcher(OptunaSampler):
    """One that is shown these coordinates by a `MetricSampler`. Its first generation is the start alone, whose value
    says how far it is from the truth.
    """

    def __init__(self, coordinates: Coordinates, sampler: BaseSampler, generation: int) -> None:
        names = [f"factor_{i}" for i in range(len(coordinates.origin))]
        self._sampler = MetricSampler(names, coordinates, sampler)
        super().__init__(coordinates, self._sampler, 1)
        self._generation = generation
        self._best = np.inf
        self._space = candidate_space(names, coordinates.low, coordinates.high)

    @property
    def spread(self) -> float | None:
        """The distance of the best trial from the truth, by its value."""
        distance = self._sampler.distance(self._best)
        return float(distance) if np.isfinite(distance) else None

    def _factors(self, params: Array) -> Array:
        return params

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        super().tell(outcomes)
        self._best = min([self._best, *(outcome.value for outcome in outcomes if not outcome.fell)])
        self._size = self._generation

    def finished(self) -> bool:
        return bool(self._sampler.distance(self._best) < CONVERGED)
