"""What a search for individual parameters ends with: a walk through the bodies that move as the best one does.

The search itself stops at one body of the many that are as good. So the last trials of a study go to the ends of the
set, the least and the largest value of each parameter, and then anywhere in it. Each is a real episode. Together they
show whether the measure can tell such bodies apart.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from metaid.episode import Outcome
from metaid.models import Array, SameMotion
from metaid.search.body_space import BodyCoordinates
from metaid.search.searcher import Searcher

WALK_GENERATION = 8  # candidates of each generation of the walk after the first, which has the ends


class Walking:
    """Another searcher for the first trials, or until it is finished; then the walk.

    As long as nothing has survived there is no body to walk from, and the search goes on.

    Args:
        search: the searcher of the first trials.
        coordinates: with the bodies and the bounds.
        seed: of the directions and lengths of the walk.
        search_trials: how many trials the search has.
    """

    def __init__(self, search: Searcher, coordinates: BodyCoordinates, seed: int, search_trials: int) -> None:
        self._search = search
        self._coordinates = coordinates
        self._random = np.random.default_rng(seed)
        self._search_trials_left = search_trials
        self._best: Array | None = None
        self._best_value = np.inf
        self._proposed = np.empty((0, 0))
        self._same_motion: SameMotion | None = None
        self._mass = np.empty(0)

    @property
    def spread(self) -> float | None:
        return self._search.spread if self._same_motion is None else None

    def ask(self) -> Array:
        low, high = self._coordinates.low, self._coordinates.high
        if self._same_motion is not None:
            proposed = self._walk(self._same_motion)
        elif self._best is not None and (self._search_trials_left <= 0 or self._search.finished()):
            self._same_motion = SameMotion(self._coordinates.bodies, self._best, low, high)
            self._mass = self._same_motion.start
            proposed = np.array([self._same_motion.factors(mass) for mass in self._same_motion.ends()])
        else:
            proposed = self._search.ask()
        self._proposed = np.clip(proposed, low, high)
        return self._proposed

    def _walk(self, bodies: SameMotion) -> Array:
        """Factors (WALK_GENERATION x 2 nlink) of bodies on the walk, each from the one before."""
        factors = []
        for _ in range(WALK_GENERATION):
            self._mass = bodies.random_point(self._mass, self._random)
            factors.append(bodies.factors(self._mass))
        return np.array(factors)

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        if self._same_motion is not None:
            return
        self._search.tell(outcomes)
        self._search_trials_left -= len(outcomes)
        for factors, outcome in zip(self._proposed, outcomes, strict=True):
            if not outcome.fell and outcome.value < self._best_value:
                self._best, self._best_value = factors, outcome.value

    def finished(self) -> bool:
        """Only where the search is finished and nothing has survived: the walk itself does not come to an end."""
        return self._best is None and self._search.finished()
