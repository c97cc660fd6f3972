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
from metaid.results.stored import StoredStudy
from metaid.results.verdict import Verdict, judge
from metaid.store import EXPERIMENT, ForeignTrial, Store, Trial, shown_trial
from metaid.study import ENDED_KEY, optuna_spec, stored_spec
from metaid.study.estimates import kept_with

if TYPE_CHECKING:
    import optuna

STATES = ["COMPLETE", "PRUNED", "FAIL"]


@dataclass(frozen=True)
class Snapshot(StoredStudy):
    """A stored study and the verdict on it."""

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
    """The trials of a study, as `trials_frame` has them."""
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
