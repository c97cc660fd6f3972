"""CMA-ES of the cmaes package, in the study's coordinates."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from metaid.episode import Outcome
from metaid.models import Array
from metaid.search.coordinates import Coordinates
from metaid.search.searcher import StepOptions

if TYPE_CHECKING:
    from cmaes import CMA

SCIPY_STATS = "scipy.stats"
RESAMPLINGS = 100  # of a candidate that leaves the bounds, before it is moved to the nearest one


def load_cmaes() -> None:
    """Loads the cmaes package. Its CMA-ES does without scipy.stats, which takes longer to load than the rest of the
    package. Only its variant with margins uses it, and where it is not installed it has functions of its own. So where
    nothing has loaded scipy.stats before, it is out of sight while the package is loaded.
    """
    is_hidden = SCIPY_STATS not in sys.modules
    if is_hidden:
        sys.modules[SCIPY_STATS] = None  # type: ignore[assignment]  # Python's word for: not to be found
    try:
        import_module("cmaes")
    finally:
        if is_hidden:
            del sys.modules[SCIPY_STATS]


class Cmaes:
    """CMA-ES of the cmaes package, in the given coordinates; candidates beyond the bounds are drawn again."""

    def __init__(self, coordinates: Coordinates, seed: int, options: StepOptions) -> None:
        self._coordinates = coordinates
        self._seed = seed
        self._options = options
        self._proposed: list[Array] = []
        # The root mean square distance of the latest candidates from the mean, along each coordinate.
        self.spread: float | None = options.sigma

    @cached_property
    def _optimizer(self) -> CMA:
        """Made for the first candidate: only a run needs the cmaes package."""
        load_cmaes()
        import cmaes

        mean = np.zeros(len(self._coordinates.origin))
        settings: dict[str, Any] = {"mean": mean, "sigma": self._options.sigma, "seed": self._seed}
        optimizer = cmaes.CMA(**settings, population_size=self._options.generation)
        size = optimizer.population_size
        if len(mean) > size:
            from metaid.search.symmetric_root import SymmetricRootCma

            optimizer = SymmetricRootCma(**settings, population_size=size)
        return optimizer

    def ask(self) -> Array:
        self._proposed = [self._candidate() for _ in range(self._optimizer.population_size)]
        self.spread = float(np.sqrt(np.mean(np.square(self._proposed - self._optimizer.mean))))
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
