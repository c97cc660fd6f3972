"""The stages of a study, each with its trials."""

from __future__ import annotations

from dataclasses import dataclass, replace

from metaid.store import Trial
from metaid.study import Problem, StudySpec

STATES = ["COMPLETE", "PRUNED", "FAIL"]


@dataclass(frozen=True)
class Stage:
    """One stage of a study with its trials."""

    problem: Problem
    trials: list[Trial]

    @property
    def survivors(self) -> list[Trial]:
        """Those that did not fall."""
        return [trial for trial in self.trials if not trial.outcome.fell]


def stages(spec: StudySpec, trials: list[Trial]) -> list[Stage]:
    """The stages of a study, those that have no trial yet too; their trials with factors of lumps, whatever was
    searched.
    """
    grouped = by_stage(spec, trials)
    survivors = [trial for trial in grouped[0] if not trial.outcome.fell]
    first = Problem(spec)
    if first.body_space is not None:
        return [Stage(first, [replace(trial, factors=first.lump_factors(trial.factors)) for trial in trials])]
    problems = first.stages(best_trial(survivors).factors if survivors else None)
    return [Stage(problem, own) for problem, own in zip(problems, grouped, strict=True)]


def by_stage(spec: StudySpec, trials: list[Trial]) -> list[list[Trial]]:
    return [[trial for trial in trials if trial.stage in (None, i + 1)] for i in range(len(spec.names))]


def best_trial(survivors: list[Trial]) -> Trial:
    """The survivor of least value, the first of equals."""
    return min(survivors, key=lambda trial: trial.outcome.value)
