"""Optuna's samplers as searchers."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import numpy as np
import optuna

from metaid.episode import Outcome
from metaid.models import Array
from metaid.search.coordinates import Coordinates
from metaid.search.searcher import GenerationOptions

GENERATION = 8  # candidates that an Optuna sampler proposes before it gets an outcome


class OptunaSampler:
    """Any Optuna sampler, on a study in memory; falls are pruned trials with the step that they survived to.

    Args:
        coordinates: what it moves in.
        make: the sampler, from the seed.
        seed: of all that the sampler draws at random.
        options: the generation size.
    """

    def __init__(
        self,
        coordinates: Coordinates,
        make: Callable[[int], optuna.samplers.BaseSampler],
        seed: int,
        options: GenerationOptions,
    ) -> None:
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._coordinates = coordinates
        self._size = options.generation or GENERATION
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            self._study = optuna.create_study(sampler=make(seed), direction="minimize")
        low, high = coordinates.box()
        self._space: dict[str, optuna.distributions.BaseDistribution] = {
            f"z_{i}": optuna.distributions.FloatDistribution(low[i], high[i]) for i in range(len(low))
        }
        self._proposed: list[optuna.Trial] = []

    @property
    def spread(self) -> float | None:
        return None

    def ask(self) -> Array:
        self._proposed = [self._study.ask(self._space) for _ in range(self._size)]
        proposed = (np.array([trial.params[key] for key in self._space]) for trial in self._proposed)
        return np.array([self._coordinates.factors(z) for z in proposed])

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        for trial, outcome in zip(self._proposed, outcomes, strict=True):
            trial.report(outcome.value, step=outcome.steps)
            if outcome.fell:
                self._study.tell(trial, state=optuna.trial.TrialState.PRUNED)
            else:
                self._study.tell(trial, outcome.value)

    def finished(self) -> bool:
        return False
