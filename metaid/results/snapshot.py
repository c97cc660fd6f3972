"""A study as the DB has it at one moment. Everything else that is known of the study follows from it.

The trials are read once, and what follows from the study's settings is made once. Tables, summary and findings are
functions of the snapshot, so they agree with one another whatever a run writes meanwhile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from metaid.errors import StudyError
from metaid.results.best import best_index
from metaid.results.verdict import Verdict, judge
from metaid.store import EXPERIMENT, ForeignTrial, Store, Trial, shown_trial
from metaid.study import (
    ENDED_KEY,
    Problem,
    StudySpec,
    optuna_spec,
    problem_of,
    stored_spec,
)
from metaid.study.estimates import StudyEstimate, estimate_from, kept_with, shown_by_others

if TYPE_CHECKING:
    import optuna

STATES = ["COMPLETE", "PRUNED", "FAIL"]


@dataclass(frozen=True)
class Snapshot:
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

    @cached_property
    def verdict(self) -> Verdict:
        """Whether it has found its lumps, and if not, why."""
        return judge(self)

    @property
    def head(self) -> dict[str, Any]:
        """What every account of it begins with: what was searched, and the verdict."""
        verdict, found = self.verdict, self.estimate
        return {
            "name": self.name,
            "plant": self.spec.plant_name,
            "sampler": self.spec.study.sampler,
            "measure": self.problem.measure.name,
            "seed": self.spec.study.seed,
            "verdict": verdict.word,
            "reasons": list(verdict.reasons),
            "source": verdict.source,
            "misfit": None if found is None else found.estimate.misfit,
        }

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


def read_snapshot(store: Store, name: str) -> Snapshot:
    """The study of that `name`, its trials read at once.  Raises StorageError."""
    spec = stored_spec(store, name)
    stored = store.read(name, spec.names)
    return Snapshot(name, spec, stored.own, stored.foreign, store.attribute(name, ENDED_KEY), kept_with(store, name))


def snapshot_of(study: optuna.Study) -> Snapshot:
    """An Optuna study, in whatever storage, whose trials `metaid.objective` evaluated.  Raises StudyError where it
    evaluated none.
    """
    spec = optuna_spec(study)
    if spec is None:
        raise StudyError(
            f"the Optuna study '{study.study_name}' has no trial of metaid's "
            "(allowed: one that has been optimized with metaid.objective)"
        )
    foreign = [
        ForeignTrial(each.number, each.state.name, each.user_attrs.get(EXPERIMENT), None, shown_trial(each, spec.names))
        for each in study.get_trials(deepcopy=False)
    ]
    return Snapshot(study.study_name, spec, [], tuple(foreign))


def counted_states(trials: Sequence[Trial]) -> dict[str, int]:
    """How many trials there are in all, and how many survived, fell and failed."""
    states = [trial.state.name for trial in trials]
    counts = {kind: states.count(state) for kind, state in zip(("complete", "pruned", "failed"), STATES, strict=True)}
    return {"total": len(trials), **counts}


def trials_table(snapshot: Snapshot) -> pd.DataFrame:
    """One row a trial: `number`, `state`, `value` (NaN where it failed), `generation`, `steps`, `periods_i` of each
    joint where they are counted, then what the candidate is, under the names of what is sought.
    """
    spec, trials = snapshot.spec, snapshot.trials
    values = [np.nan if trial.outcome.failure is not None else trial.outcome.value for trial in trials]
    numbers = {
        "generation": [trial.generation for trial in trials],
        "steps": [trial.outcome.steps for trial in trials],
        **{
            f"periods_{joint + 1}": [trial.outcome.periods[joint] for trial in trials]
            for joint in range(spec.joints_with_periods)
        },
    }
    candidates = np.array([trial.factors for trial in trials]).reshape(len(trials), len(spec.names))
    columns = {
        "number": np.array([trial.number for trial in trials], dtype=np.int64),
        "state": pd.Categorical([trial.state.name for trial in trials], STATES),
        "value": np.array(values, dtype=np.float64),
        **{key: np.array(column, dtype=np.int64) for key, column in numbers.items()},
        **dict(zip(spec.names, candidates.T, strict=True)),
    }
    return pd.DataFrame(columns)
