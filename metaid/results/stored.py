"""A study as the DB has it at one moment, before anything is judged."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from metaid.results.best import best_index
from metaid.store import ForeignTrial, Trial
from metaid.study import Problem, StudySpec, problem_of
from metaid.study.estimates import StudyEstimate, estimate_from, shown_by_others


@dataclass(frozen=True)
class StoredStudy:
    """A study's `name`, its settings, and all its `trials`; the `foreign` trials of the study, which metaid did not
    write; with how many trials its search `ended`, None where no run got so far; and what the DB has `kept` of the
    estimate.
    """

    name: str
    spec: StudySpec
    trials: list[Trial]
    foreign: tuple[ForeignTrial, ...] = ()
    ended: int | None = None
    kept: Any = None

    @property
    def is_finished(self) -> bool:
        """Whether nothing is left to do: all trials of the study are there, or its search stopped before."""
        return len(self.trials) >= self.spec.study.trials or len(self.trials) == self.ended

    @cached_property
    def problem(self) -> Problem:
        """What follows from its settings."""
        return problem_of(self.spec)

    @property
    def survivors(self) -> list[Trial]:
        """Trials that neither fell nor failed."""
        return [trial for trial in self.trials if not trial.outcome.fell]

    @property
    def best(self) -> Trial | None:
        """The best of these; None where there is none."""
        survivors = self.survivors
        if not survivors:
            return None
        return survivors[best_index(np.array([trial.outcome.value for trial in survivors]))]

    @cached_property
    def estimate(self) -> StudyEstimate | None:
        """What all trials say together, those of others that carry motion included; None where nothing can be made of
        them.
        """
        found: StudyEstimate | None = estimate_from(self.kept, self.problem, self.trials, self.foreign)
        return found

    @property
    def why_no_estimate(self) -> str:
        """Why there is none."""
        problem = self.problem
        tried = [*self.trials, *shown_by_others(problem, self.foreign)]
        if not problem.spec.study.estimate.enabled:
            return "[estimate] enabled is false"
        if not problem.can_be_estimated:
            return "its episodes keep no windows of motion"
        if not tried:
            return "it has no trial yet: run it first"
        windows = [each.outcome.windows.seen for each in tried if each.outcome.windows is not None]
        readings = [each.outcome.readings.steps for each in tried if each.outcome.readings is not None]
        if not windows and not readings:
            return f"no trial in the DB has {'readings' if problem.spec.keeps_readings else 'windows of its motion'}"
        if not any(each.any() for each in (*windows, *readings)):
            return "every trial fell within its shortest window"
        return "the twin cannot follow these trials from any model near the nominal one"
