"""CMA-ES of the cmaes package, in the study's coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from metaid.episode import Outcome
from metaid.models import Array
from metaid.search.coordinates import Coordinates
from metaid.search.searcher import StepOptions

RESAMPLINGS = 100  # of a candidate that leaves the bounds, before it is moved to the nearest one


class Cmaes:
    """CMA-ES of the cmaes package, in the given coordinates; candidates beyond the bounds are drawn again."""

    def __init__(self, coordinates: Coordinates, seed: int, options: StepOptions) -> None:
        import cmaes  # slow to load, with all of scipy.stats, and only a run needs it

        self._coordinates = coordinates
        mean = np.zeros(len(coordinates.origin))
        self._optimizer = cmaes.CMA(mean=mean, sigma=options.sigma, seed=seed, population_size=options.generation)
        size = self._optimizer.population_size
        if len(mean) > size:
            from metaid.search.symmetric_root import SymmetricRootCma

            self._optimizer = SymmetricRootCma(mean=mean, sigma=options.sigma, seed=seed, population_size=size)
        self._proposed: list[Array] = []
        self._spread = options.sigma

    @property
    def spread(self) -> float | None:
        """The root mean square distance of the latest candidates from the mean, along each coordinate."""
        return self._spread

    def ask(self) -> Array:
        self._proposed = [self._candidate() for _ in range(self._optimizer.population_size)]
        self._spread = float(np.sqrt(np.mean(np.square(self._proposed - self._optimizer.mean))))
        return np.array([self._coordinates.factors(z) for z in self._proposed])

    def _candidate(self) -> Array:
        for _ in range(RESAMPLINGS):
            z: Array = self._optimizer.ask()
            if self._coordinates.inside(z):
                return z
        return self._coordinates.z(self._coordinates.factors(z))

    def widen(self, coordinates: Coordinates) -> None:
        self._coordinates = coordinates

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        self._optimizer.tell([(z, outcome.value) for z, outcome in zip(self._proposed, outcomes, strict=True)])

    def finished(self) -> bool:
        return bool(self._optimizer.should_stop())
