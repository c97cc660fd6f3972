"""Where a run of a study stands: its trials, the searcher that has their outcomes, and the candidates that come next.

It evaluates nothing and writes nothing. The next candidates depend on the trials alone. So a run that was stopped
anywhere is brought back to where it was by replaying the trials that the DB holds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from optuna.trial import TrialState

from metaid.episode import Outcome
from metaid.errors import StorageError
from metaid.models import Array
from metaid.search import OutputError
from metaid.store import Trial
from metaid.study.problem import Problem

HELD_BACK = 0.25  # of a study's trials, after which a search whose best trial is at a bound is held back by it
REPLAY_TOLERANCE = 1e-6  # relative; another machine's linear algebra may round differently


@dataclass(frozen=True)
class Progress:
    """How far a run is: trials done, how many of them fell, trials in all, the best survivor, the
    searcher's spread, the generation, the `problem`; what it is `waiting` for, if it is.
    """

    trials: int
    falls: int
    total: int
    best: Trial | None
    spread: float | None
    generation: int
    problem: Problem
    waiting: str | None = None


class Run:
    """A run up to `total` trials, which ends at the target, too, or when its searcher is finished. Given `until`, a
    searcher whose intervals get narrower is finished once half the widest of them is that share of its lump.
    """

    def __init__(self, problem: Problem, total: int, until: float | None = None) -> None:
        self.total, self.problem = total, problem
        self.number = self.falls = self.generation = 0
        self.best: Trial | None = None
        self._searcher: Any = problem.make_searcher()
        if isinstance(self._searcher, OutputError):
            self._searcher.until = until
        self._patient_until = HELD_BACK * problem.spec.study.trials
        self._batch: Array | None = None
        self._outcomes: list[Outcome] = []

    @property
    def progress(self) -> Progress:
        searcher = self._searcher
        return Progress(self.number, self.falls, self.total, self.best, searcher.spread, self.generation, self.problem)

    @property
    def done(self) -> bool:
        target = self.problem.spec.study.search.target
        reached = target is not None and self.best is not None and self.best.outcome.value <= target
        return self.number >= self.total or (not self._outcomes and (reached or self._searcher.finished()))

    def candidates(self) -> Array:
        """Factors (ncandidate x nlump) of the trials that come next: what is left of the generation, or a new one."""
        if self._batch is None:
            self._batch = self._searcher.ask()
        have = len(self._outcomes)
        return self._batch[have : have + self.total - self.number]

    def add(self, trials: list[Trial]) -> None:
        """Takes in what became of `candidates`, or of the first of them."""
        for trial in trials:
            self.number += 1
            self.falls += trial.state == TrialState.PRUNED
            if not trial.outcome.fell and (self.best is None or trial.outcome.value < self.best.outcome.value):
                self.best = trial
        self._outcomes += [trial.outcome for trial in trials]
        if self._batch is not None and len(self._outcomes) == len(self._batch):
            if self.number < self.total:  # a search that asks no more need not match the last trials: the estimate does
                self._searcher.tell(self._outcomes)
            self._batch, self._outcomes = None, []
            self.generation += 1
            self._widen_bounds()

    def _widen_bounds(self) -> None:
        """Moves the bounds away that the best trial is at, where the measure says that something better is beyond."""
        problem, best = self.problem, self.best
        if best is None or self.number < self._patient_until or not problem.widens:
            return
        if best.outcome.value > problem.resolution and (coordinates := problem.widen(best.factors)) is not None:
            self._searcher.widen(coordinates)

    def replay(self, trials: list[Trial], where: str) -> None:
        """Takes in all that the DB holds.  Raises StorageError where it does not follow from the settings."""
        while self.number < len(trials):
            batch = self.candidates()
            stored = trials[self.number : self.number + len(batch)]
            if not len(batch) or not all(map(_same, batch, [trial.factors for trial in stored])):
                raise StorageError(
                    f"{where}: trial {self.number} and on do not follow from its settings and seed: "
                    "made by another version, or changed"
                )
            self.add(stored)


def _same(proposed: Array, stored: Array) -> bool:
    return len(proposed) == len(stored) and bool(np.allclose(proposed, stored, rtol=REPLAY_TOLERANCE, atol=0.0))
