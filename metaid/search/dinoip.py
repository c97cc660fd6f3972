"""The paper's own search, DINOIP (its section III.B and Fig. 3): from large values, step by step, down to the fall.

The lumps step down by an increment, first all together, as in the paper's Table II, then each in turn. A step after
which the frequency has fallen or stayed is kept; one after which the pendulum falls is taken back. So are steps after
which the frequency stays up; a passing rise is no reason to stop, for on more than one link the number of periods is
that of a beat and goes up and down by one or two on its way down. The search ends where no step helps.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from metaid.episode import Outcome
from metaid.files import Settings
from metaid.models import Array
from metaid.search.coordinates import Coordinates

COARSE = 10  # increments in a coarse step
PATIENCE = 5  # steps in a row that may fail to lower the frequency before they are taken back
DECIMALS = 12  # of a factor: thirty steps of 0.01 down from 1.3 are 1, and not nearly 1

Walk = Generator[Array, Outcome, None]


class DinoipOptions(Settings):
    """`increment`: of the factors, in each step; `coarse_to_fine`: steps of ten increments first."""

    increment: Annotated[float, Field(ge=1e-6, le=1)] = 0.01
    coarse_to_fine: bool = False


class Dinoip:
    """One candidate a generation, for the next step depends on what became of the last. It steps in the factors
    themselves, whatever the coordinates, and draws nothing at random. A start that falls ends it at once: there is
    nothing to step back to.
    """

    def __init__(self, coordinates: Coordinates, options: DinoipOptions) -> None:
        self._low = coordinates.low
        increment = options.increment
        self._increments = [COARSE * increment, increment] if options.coarse_to_fine else [increment]
        self._step = self._increments[0]
        self._best, self._value = coordinates.origin, np.inf
        self._known: dict[tuple[float, ...], Outcome] = {}  # so that no candidate is tried twice
        self._walk = self._search()
        self._candidate: Array | None = next(self._walk)

    @property
    def spread(self) -> float | None:
        return self._step

    def ask(self) -> Array:
        return np.array([self._candidate])

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        try:
            self._candidate = self._walk.send(outcomes[0])
        except StopIteration:
            self._candidate = None

    def finished(self) -> bool:
        return self._candidate is None

    def _search(self) -> Walk:
        """Yields candidates (nlump) and is sent their outcomes, until no step helps."""
        outcome = yield self._best
        if outcome.fell:
            return
        self._value = outcome.value
        each = np.eye(len(self._best))
        for step in self._increments:
            self._step = step
            yield from self._descend(each.sum(axis=0))
            before = None
            while before is None or (self._best < before).any():
                before = self._best
                for lump in each:
                    yield from self._descend(lump)

    def _descend(self, lumps: Array) -> Walk:
        """Steps down with `lumps` (nlump, 1 for those that step) from the best candidate, as long as it helps."""
        candidate, failures = self._best, 0
        while failures <= PATIENCE:
            candidate = np.round(candidate - self._step * lumps, DECIMALS)
            if (candidate < self._low).any():
                return
            key = tuple(candidate)
            if key not in self._known:
                self._known[key] = yield candidate
            outcome = self._known[key]
            if outcome.fell:
                return
            if outcome.value <= self._value:
                self._best, self._value, failures = candidate, outcome.value, 0
            else:
                failures += 1
