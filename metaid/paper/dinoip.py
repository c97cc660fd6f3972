"""The paper's own search, DINOIP (its section III.B and Fig. 3): from large values, step by step, down to the fall.

The factors step down by an increment, first all together, as in the paper's Table II, then each in turn. A step after
which the frequency is lower or the same is kept. A step after which the pendulum falls is taken back. Steps after which
the frequency stays higher are taken back, too, but only after some more: on more than one link the counted periods are
those of a beat, whose number goes up by one or two on its way down. The search ends where no step helps.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from metaid.episode import Outcome
from metaid.files import Settings
from metaid.models import Array

INCREMENTS_IN_COARSE_STEP = 10
MOST_STEPS_UP = 5  # steps in a row after which the frequency may be higher, before all of them are taken back
DECIMALS = 12  # of a factor: thirty steps of 0.01 down from 1.3 are 1, and not nearly 1

Steps = Generator[Array, Outcome, None]  # yields a candidate (nlump), is sent its outcome


class DinoipOptions(Settings):
    """`increment`: of the factors, in each step; `coarse_to_fine`: steps of ten increments first."""

    increment: Annotated[float, Field(ge=1e-6, le=1)] = 0.01
    coarse_to_fine: bool = False


class Dinoip:
    """One candidate a generation, for the next step depends on what became of the last.

    It steps in the factors themselves, from the `start` (nlump) down to `low` (nlump), and draws nothing at random. A
    start that falls ends it at once: there is nothing to step back to.
    """

    def __init__(self, start: Array, low: Array, options: DinoipOptions) -> None:
        self._low = low
        increment = options.increment
        self._increments = [INCREMENTS_IN_COARSE_STEP * increment, increment] if options.coarse_to_fine else [increment]
        self._step = self._increments[0]
        self._best, self._best_value = start, np.inf
        self._outcomes: dict[tuple[float, ...], Outcome] = {}  # by candidate, so that none is tried twice
        self._steps = self._search()
        self._candidate: Array | None = next(self._steps)

    @property
    def spread(self) -> float | None:
        return self._step

    def ask(self) -> Array:
        return np.array([self._candidate])

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        try:
            self._candidate = self._steps.send(outcomes[0])
        except StopIteration:
            self._candidate = None

    def finished(self) -> bool:
        return self._candidate is None

    def _search(self) -> Steps:
        """Yields candidates (nlump) and is sent their outcomes, until no step helps."""
        outcome = yield self._best
        if outcome.fell:
            return
        self._best_value = outcome.value
        each = np.eye(len(self._best))
        for step in self._increments:
            self._step = step
            yield from self._descend(each.sum(axis=0))
            before = None
            while before is None or (self._best < before).any():
                before = self._best
                for lump in each:
                    yield from self._descend(lump)

    def _descend(self, lumps: Array) -> Steps:
        """Steps down with `lumps` (nlump, 1 for those that step) from the best candidate, as long as it helps."""
        candidate, steps_up = self._best, 0
        while steps_up <= MOST_STEPS_UP:
            candidate = np.round(candidate - self._step * lumps, DECIMALS)
            if (candidate < self._low).any():
                return
            key = tuple(candidate)
            if key not in self._outcomes:
                self._outcomes[key] = yield candidate
            outcome = self._outcomes[key]
            if outcome.fell:
                return
            if outcome.value <= self._best_value:
                self._best, self._best_value, steps_up = candidate, outcome.value, 0
            else:
                steps_up += 1
