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
from metaid.results.estimates import StudyEstimate, has_motion_of, study_estimate
from metaid.store import EXPERIMENT, ForeignTrial, Store, Trial, shown_trial
from metaid.study import ENDED_KEY, ArmSpec, Problem, StudySpec, optuna_spec, stored_spec

if TYPE_CHECKING:
    import optuna

STATES = ["COMPLETE", "PRUNED", "FAIL"]


@dataclass(frozen=True)
class Snapshot:
    """A study's `name`, its settings, and all its `trials`; the `foreign` trials of the study, which metaid did not
    write; and with how many trials its search `ended`, None where no run got so far.
    """

    name: str
    spec: StudySpec
    trials: list[Trial]
    foreign: tuple[ForeignTrial, ...] = ()
    ended: int | None = None

    @property
    def is_finished(self) -> bool:
        """Whether nothing is left to do: all trials of the study are there, or its search stopped before."""
        return len(self.trials) >= self.spec.study.trials or len(self.trials) == self.ended

    @cached_property
    def problem(self) -> Problem:
        """What follows from its settings."""
        return Problem(self.spec)

    @property
    def survivors(self) -> list[Trial]:
        """Trials that did not fall."""
        return surviving(self.trials)

    @cached_property
    def evaluated(self) -> list[ForeignTrial]:
        """The trials of others that `metaid.objective` evaluated with the settings of this study."""
        return [each for each in self.foreign if each.experiment == self.spec.experiment]

    @cached_property
    def shown_by_others(self) -> list[Trial]:
        """Those of them that carry motion, each once."""
        carried = [each.shown for each in self.evaluated if each.shown is not None]
        fits = [each for each in carried if has_motion_of(self.problem.episode, each.outcome)]
        return [each for i, each in enumerate(fits) if not any(_is_copy(each, earlier) for earlier in fits[:i])]

    @property
    def all_shown(self) -> list[Trial]:
        """The trials that an estimate may be made of."""
        return [*self.trials, *self.shown_by_others]

    @cached_property
    def estimate(self) -> StudyEstimate | None:
        """What all trials say together, those of others that carry motion included; None where nothing can be made of
        them.
        """
        return study_estimate(self.problem, self.trials, self.shown_by_others)


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
    return Snapshot(name, spec, stored.own, stored.foreign, store.attribute(name, ENDED_KEY))


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


def _is_copy(one: Trial, other: Trial) -> bool:
    """Whether two trials are one trial and its copy, as Optuna's `add_trials` makes them."""
    shown, read = one.outcome.windows, one.outcome.readings
    if not np.array_equal(one.factors, other.factors):
        return False
    if shown is not None:
        return other.outcome.windows is not None and np.array_equal(shown.motion, other.outcome.windows.motion)
    return (
        read is not None
        and other.outcome.readings is not None
        and np.array_equal(read.angles, other.outcome.readings.angles)
    )


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
