"""A study as the DB has it at one moment. Everything else that is known of the study follows from it.

The trials are read once, and each stage's `Problem` is made once. Tables, summary and findings are functions of the
snapshot, so they agree with one another whatever a run writes meanwhile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from metaid.results.best import first_of_best
from metaid.results.estimates import StudyEstimate, study_estimate
from metaid.store import ForeignTrial, Store, Trial
from metaid.study import Problem, StudySpec, stored_spec

STATES = ["COMPLETE", "PRUNED", "FAIL"]


@dataclass(frozen=True)
class Stage:
    """One stage of a study: its `problem`, and its `trials` with factors of lumps, whatever was searched."""

    problem: Problem
    trials: list[Trial]

    @property
    def survivors(self) -> list[Trial]:
        """Trials that did not fall."""
        return surviving(self.trials)


@dataclass(frozen=True)
class Snapshot:
    """A study's `name`, its settings, and all its `trials`, with factors of what was searched; and the `foreign` trials
    of the study, which metaid did not write.
    """

    name: str
    spec: StudySpec
    trials: list[Trial]
    foreign: tuple[ForeignTrial, ...] = ()

    @cached_property
    def stages(self) -> list[Stage]:
        """The stages of the study, those without a trial included."""
        first, grouped = Problem(self.spec), trials_by_stage(self.spec, self.trials)
        if first.body_space is not None:
            return [Stage(first, [replace(each, factors=first.lump_factors(each.factors)) for each in self.trials])]
        survivors = surviving(grouped[0])
        problems = first.stages(first_of_best(survivors).factors if survivors else None)
        return [Stage(problem, own) for problem, own in zip(problems, grouped, strict=True)]

    @cached_property
    def estimate(self) -> StudyEstimate | None:
        """What all trials of the first stage say together; None where nothing can be made of them."""
        return study_estimate(self.first, self.stages[0].trials)

    @property
    def first(self) -> Problem:
        """The problem of the first stage."""
        return self.stages[0].problem


def read_snapshot(store: Store, name: str) -> Snapshot:
    """The study of that `name`, its trials read at once.  Raises StorageError."""
    spec = stored_spec(store, name)
    stored = store.read(name, *spec.names)
    return Snapshot(name, spec, stored.own, stored.foreign)


def trials_by_stage(spec: StudySpec, trials: list[Trial]) -> list[list[Trial]]:
    """The trials of each stage."""
    return [[trial for trial in trials if trial.stage in (None, i + 1)] for i in range(len(spec.names))]


def surviving(trials: Sequence[Trial]) -> list[Trial]:
    """Those of the `trials` that neither fell nor failed."""
    return [trial for trial in trials if not trial.outcome.fell]
