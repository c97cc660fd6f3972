"""What a study found, as pandas frames."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd

from metaid.errors import StudyError
from metaid.results.body_tables import parameters_of
from metaid.results.identified import lumps_of_stage
from metaid.results.overview import summary
from metaid.results.stage import STATES, by_stage, stages
from metaid.store import Store, Trial
from metaid.study import Problem, stored_spec


def trials_frame(store: Store, name: str) -> pd.DataFrame:
    """One row a trial: `number`, `state`, `value` (NaN where it failed), `generation`, `steps`, `periods_i`, `stage` if
    the study has two, then a factor per lump, under its name; NaN where the trial's stage does not search it. A search
    of individual parameters has a factor per parameter before those of the lumps that follow from them.
    """
    spec = stored_spec(store, name)
    names = list(itertools.chain(*spec.names))
    trials = store.trials(name, *spec.names)
    heads = {
        "number": np.array([trial.number for trial in trials], dtype=np.int64),
        "state": pd.Categorical([trial.state.name for trial in trials], STATES),
        "value": np.array([_value(trial) for trial in trials], dtype=np.float64),
        "generation": np.array([trial.generation for trial in trials], dtype=np.int64),
        "steps": np.array([trial.outcome.steps for trial in trials], dtype=np.int64),
    }
    periods = {
        f"periods_{joint + 1}": np.array([trial.outcome.periods[joint] for trial in trials], dtype=np.int64)
        for joint in range(len(spec.nominal))
    }
    if len(spec.names) > 1:
        heads["stage"] = np.array([trial.stage for trial in trials], dtype=np.int64)
    factors, row, column = np.full((len(trials), len(names)), np.nan), 0, 0
    for searched, own in zip(spec.names, by_stage(spec, trials), strict=True):
        rows, columns = slice(row, row + len(own)), slice(column, column + len(searched))
        factors[rows, columns] = np.array([trial.factors for trial in own]).reshape(len(own), len(searched))
        row, column = rows.stop, columns.stop
    searched_factors = {name: factors[:, i] for i, name in enumerate(names)}
    if spec.study.search.space == "parameters":
        problem = Problem(spec)
        searched_factors |= dict(zip(problem.names, problem.lump_factors(factors).T, strict=True))
    return pd.DataFrame({**heads, **periods, **searched_factors})


def _value(trial: Trial) -> float:
    return np.nan if trial.outcome.failure is not None else trial.outcome.value


def lumps_frame(store: Store, name: str) -> pd.DataFrame:
    """One row a lump: `name`, `unit`, `nominal`, `factor`, `identified`, `low`, `high`, `true`, `error`,
    `determined`; NaN where not known. Of a lump that the study's measure cannot determine, nothing is said.
    """
    spec = stored_spec(store, name)
    return pd.concat(
        [lumps_of_stage(stage) for stage in stages(spec, store.trials(name, *spec.names))], ignore_index=True
    )


def parameters_frame(store: Store, name: str) -> pd.DataFrame:
    """One row a parameter of a study that searches individual ones: `name`, `unit`, `nominal`, its range `low` to
    `high` over the bodies that are as good as the best, `true` where the plant knows it, and how many `bodies` these
    are.  Raises StudyError of another study.
    """
    spec = stored_spec(store, name)
    if spec.study.search.space == "lumps":
        raise StudyError(f"study '{name}' searches lumps (allowed: one with search.space = 'parameters')")
    return parameters_of(Problem(spec), store.trials(name, *spec.names))


def studies_frame(store: Store) -> pd.DataFrame:
    """One row a study: `name`, `plant`, `sampler`, `measure`, `trials`, `pruned`, `best`, `max_error`."""
    rows = []
    for name in store.names():
        shown = summary(store, name)
        counts = {"trials": shown["trials"]["total"], "pruned": shown["trials"]["pruned"]}
        rows.append(
            {
                **{key: shown[key] for key in ("name", "plant", "sampler", "measure")},
                **counts,
                "best": shown["best"]["value"],
                "max_error": shown["max_error"],
            }
        )
    words = {"name": str, "plant": str, "sampler": str, "measure": str}
    kinds = {**words, "trials": np.int64, "pruned": np.int64, "best": np.float64, "max_error": np.float64}
    return pd.DataFrame(rows, columns=list(kinds)).astype(kinds)
