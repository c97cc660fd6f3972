"""A study of an arm as the DB has it at one moment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from metaid.models.tree import Tree
from metaid.results.best import best_trial
from metaid.results.snapshot import surviving
from metaid.store import ForeignTrial, Trial
from metaid.study import ArmProblem, ArmSpec, problem_of
from metaid.study.estimates import ArmFound, estimate_from


@dataclass(frozen=True)
class ArmSnapshot:
    """A study's `name`, its settings and all its `trials`; the `foreign` ones, which metaid did not write; and with how
    many trials its search `ended`, None where no run got so far; and what the DB has `kept` of the estimate.
    """

    name: str
    spec: ArmSpec
    trials: list[Trial]
    foreign: tuple[ForeignTrial, ...] = ()
    ended: int | None = None
    kept: Any = None

    @property
    def is_finished(self) -> bool:
        """Whether nothing is left to do: all trials of the study are there, or its search stopped before."""
        return len(self.trials) >= self.spec.study.trials or len(self.trials) == self.ended

    @cached_property
    def problem(self) -> ArmProblem:
        """What follows from its settings."""
        return problem_of(self.spec)

    @cached_property
    def estimate(self) -> ArmFound | None:
        """What all trials say together; None where nothing can be made of them."""
        found: ArmFound | None = estimate_from(self.kept, self.problem, self.trials)
        return found

    @property
    def why_no_estimate(self) -> str:
        """Why there is none."""
        if not self.trials:
            return "it has no trial yet"
        if not self.spec.study.estimate.enabled:
            return "[estimate] enabled is false"
        return "no arm near the nominal one shows what the trials showed"

    @cached_property
    def best(self) -> Trial | None:
        """The best of the trials that did not fall; None where all did."""
        survivors = surviving(self.trials)
        return best_trial(survivors) if survivors else None

    @cached_property
    def truth(self) -> Tree | None:
        """The true arm, where it is known: here, and only here, it meets the result."""
        return self.problem.truth
