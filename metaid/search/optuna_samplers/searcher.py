"""Optuna's samplers as searchers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import optuna

from metaid.episode import Outcome
from metaid.models import Array
from metaid.search.coordinates import Coordinates
from metaid.search.optuna_samplers.metric import MetricSampler
from metaid.search.searcher import GenerationOptions

GENERATION = 8  # candidates that an Optuna sampler proposes before it gets an outcome
CONVERGED = 1e-6  # distance to the truth, in factors of the least determined lump


class OptunaSampler:
    """Any Optuna sampler, on a study in memory, in the given coordinates; falls are pruned trials with the step that
    they survived to.

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

    Args:
        coordinates: what it moves in.
        make: the sampler, from the seed.
        seed: of all that the sampler draws at random.
        options: the generation size, for which there is a default.
        generation: this default.
    """

    def __init__(
        self,
        coordinates: Coordinates,
        make: Callable[[int], optuna.samplers.BaseSampler],
        seed: int,
        options: GenerationOptions,
        generation: int,
    ) -> None:
        names = [f"factor_{i}" for i in range(len(coordinates.origin))]
        self._sampler = MetricSampler(names, coordinates, make(seed))
        super().__init__(coordinates, lambda _: self._sampler, seed, options)
        self._generation = options.generation or generation
        self._size = 1
        self._best = np.inf
        bounds = zip(names, coordinates.low.tolist(), coordinates.high.tolist(), strict=True)
        self._space = {name: optuna.distributions.FloatDistribution(low, high) for name, low, high in bounds}

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
