"""Thinned companions of studies too long for a browser: an Optuna study beside the original, with the best trials and
others evenly from first to last.
"""

from __future__ import annotations

import math
from typing import Any

import optuna
import pandas as pd
from optuna.trial import TrialState, create_trial

from metaid.results import Findings, best_and_even
from metaid.search import candidate_space
from metaid.store import COMPANION, Store

MOST_TRIALS_SHOWN = 10_000  # trials that a browser shows without hanging
KEPT = 1_000  # trials of a companion


def is_long(found: Findings) -> bool:
    """Whether a study has more trials than a browser shows without hanging."""
    return len(found.trials) > MOST_TRIALS_SHOWN


def companion_name(name: str) -> str:
    """What the companion of a study is called in the DB."""
    return name + COMPANION


def thinned(trials: pd.DataFrame) -> pd.DataFrame:
    """At most KEPT rows of `trials`, in order: a quarter of them the best survivors, the others evenly spaced."""
    return best_and_even(trials, KEPT, KEPT // 4).sort_values("number")


def write_companion(store: Store, found: Findings) -> optuna.Study:
    """Makes or renews the companion; each of its trials says in `trial` which one of the study it is."""
    delete_companion(store, found.name)
    names, space = found.names, candidate_space(found.names, found.problem.low, found.problem.high)
    companion = optuna.create_study(storage=store.optuna, study_name=companion_name(found.name))
    numbers = ["generation", "steps", *(f"periods_{joint + 1}" for joint in range(found.spec.joints_with_periods))]
    companion.add_trials(
        create_trial(
            state=TrialState[row["state"]],
            value=row["value"] if row["state"] == "COMPLETE" else None,
            params={lump: row[lump] for lump in names},
            distributions=space,
            user_attrs={"trial": row["number"], **{key: row[key] for key in numbers}},
            intermediate_values=_reported(row),
        )
        for row in thinned(found.trials).to_dict("records")
    )
    return companion


def _reported(row: dict[Any, Any]) -> dict[int, float]:
    """The intermediate values of a trial: none where it failed, NaN where it fell, as in its study."""
    return {} if row["state"] == "FAIL" else {row["steps"]: row["value"] if row["state"] == "COMPLETE" else math.nan}


def delete_companion(store: Store, name: str) -> None:
    """Deletes the companion of a study, if it has one."""
    if companion_name(name) in optuna.get_all_study_names(store.optuna):
        optuna.delete_study(study_name=companion_name(name), storage=store.optuna)
