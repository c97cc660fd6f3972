"""What a search for individual parameters ends with: a walk through the bodies that move as the best one does.

The search itself stops at one body of the many that are as good. So the last trials of a study go to the ends of the
set, the least and the largest value of each parameter, and then anywhere in it: each is a real episode, and what they
show is whether the measure can tell such bodies apart.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from metaid.episode import Outcome
from metaid.models import Array, SameMotion
from metaid.search.body_space import BodyCoordinates
from metaid.search.searcher import Searcher

BATCH = 8  # candidates of a generation of the walk, after the first


class Walking:
    """Another searcher for the first `search_trials`, or until it is finished; then the walk.

    As long as nothing has survived there is nowhere to walk, and the search goes on.
    """

    def __init__(self, inner: Searcher, coordinates: BodyCoordinates, seed: int, search_trials: int) -> None:
        self._inner = inner
        self._coordinates = coordinates
        self._random = np.random.default_rng(seed)
        self._left = search_trials
        self._best: Array | None = None
        self._best_value = np.inf
        self._proposed = np.empty((0, 0))
        self._set: SameMotion | None = None
        self._mass = np.empty(0)

    @property
    def spread(self) -> float | None:
        return self._inner.spread if self._set is None else None

    def ask(self) -> Array:
        if self._set is not None:
            self._proposed = np.array([self._set.factors(self._next()) for _ in range(BATCH)])
        elif self._best is not None and (self._left <= 0 or self._inner.finished()):
            bounds = self._coordinates.low, self._coordinates.high
            self._set = SameMotion(self._coordinates.bodies, self._best, *bounds)
            self._mass = self._set.start
            self._proposed = np.array([self._set.factors(mass) for mass in self._set.ends()])
        else:
            self._proposed = self._inner.ask()
        return np.clip(self._proposed, self._coordinates.low, self._coordinates.high)

    def _next(self) -> Array:
        assert self._set is not None
        self._mass = self._set.random_point(self._mass, self._random)
        return self._mass

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        if self._set is not None:
            return
        self._inner.tell(outcomes)
        self._left -= len(outcomes)
        for factors, outcome in zip(self._proposed, outcomes, strict=True):
            if not outcome.fell and outcome.value < self._best_value:
                self._best, self._best_value = factors, outcome.value

    def finished(self) -> bool:
        """Never: a set is not used up."""
        return False
