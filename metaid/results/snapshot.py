"""A study as the DB has it at one moment. Everything else that is known of the study follows from it.

The trials are read once, and the study's `Problem` is made once. Tables, summary and findings are functions of the
snapshot, so they agree with one another whatever a run writes meanwhile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from metaid.errors import StudyError
from metaid.store import EXPERIMENT, ForeignTrial, Store, Trial, shown_trial
from metaid.study import ENDED_KEY, ArmSpec, Problem, StudySpec, optuna_spec, problem_of, stored_spec
from metaid.study.estimates import ChainFound, estimate_from, kept_with, shown_by_others

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
        """Trials that did not fall."""
        return surviving(self.trials)

    @property
    def all_shown(self) -> list[Trial]:
        """The trials that an estimate may be made of."""
        return [*self.trials, *shown_by_others(self.problem, self.foreign)]

    @cached_property
    def estimate(self) -> ChainFound | None:
        """What all trials say together, those of others that carry motion included; None where nothing can be made of
        them.
        """
        found: ChainFound | None = estimate_from(self.kept, self.problem, self.trials, self.foreign)
        return found


def read_snapshot(store: Store, name: str) -> Snapshot:
    """The study of a chain of that `name`, its trials read at once.  Raises StorageError, and StudyError where it is of
    an arm.
    """
    spec = stored_spec(store, name)
    if isinstance(spec, ArmSpec):
        raise StudyError(
            f"study '{name}' is of the arm {spec.plant_name} "
            "(allowed of an arm: study run, show, list, validate, plot, report, export, model and delete; "
            "metaid.summary, lumps and trials)"
        )
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


def surviving(trials: Sequence[Trial]) -> list[Trial]:
    """Those of the `trials` that neither fell nor failed."""
    return [trial for trial in trials if not trial.outcome.fell]


def trial_columns(trials: Sequence[Trial]) -> dict[str, Any]:
    """What a frame has of each trial (ntrial), whatever was searched: `number`, `state`, `value` (NaN where it failed),
    `generation`, `steps`.
    """
    values = [np.nan if trial.outcome.failure is not None else trial.outcome.value for trial in trials]
    return {
        "number": np.array([trial.number for trial in trials], dtype=np.int64),
        "state": pd.Categorical([trial.state.name for trial in trials], STATES),
        "value": np.array(values, dtype=np.float64),
        "generation": np.array([trial.generation for trial in trials], dtype=np.int64),
        "steps": np.array([trial.outcome.steps for trial in trials], dtype=np.int64),
    }
