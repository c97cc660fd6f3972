"""What a study found, as pandas frames and as the JSON of `study show`. Here, and only here, the truth meets the
result.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.chain import lump_unit
from metaid.identifiability import identifiability
from metaid.problem import Problem
from metaid.rows import Trial
from metaid.store import Store
from metaid.study import stored_spec

STATES = ["COMPLETE", "PRUNED", "FAIL"]


def trials_frame(store: Store, name: str) -> pd.DataFrame:
    """One row a trial: `number`, `state`, `value` (NaN where it failed), `generation`, `steps`, `periods_i`, then a
    factor per lump, under its name.
    """
    problem = Problem(stored_spec(store, name))
    names = problem.names
    trials = store.trials(name, names)
    heads = {
        "number": np.array([trial.number for trial in trials], dtype=np.int64),
        "state": pd.Categorical([trial.state.name for trial in trials], STATES),
        "value": np.array([_value(trial) for trial in trials], dtype=np.float64),
        "generation": np.array([trial.generation for trial in trials], dtype=np.int64),
        "steps": np.array([trial.outcome.steps for trial in trials], dtype=np.int64),
    }
    periods = {
        f"periods_{joint + 1}": np.array([trial.outcome.periods[joint] for trial in trials], dtype=np.int64)
        for joint in range(problem.nominal.nlink)
    }
    factors = np.array([trial.factors for trial in trials]).reshape(len(trials), len(names))
    return pd.DataFrame({**heads, **periods, **{lump: factors[:, i] for i, lump in enumerate(names)}})


def _value(trial: Trial) -> float:
    return np.nan if trial.outcome.failure is not None else trial.outcome.value


def lumps_frame(store: Store, name: str) -> pd.DataFrame:
    """One row a lump: `name`, `unit`, `nominal`, `factor`, `identified`, `low`, `high`, `true`, `error`,
    `determined`; NaN where not known. Of a lump that the study's measure cannot determine, nothing is said.
    """
    problem = Problem(stored_spec(store, name))
    return _lumps(problem, store.trials(name, problem.names))


def _lumps(problem: Problem, trials: list[Trial]) -> pd.DataFrame:
    survivors = [trial for trial in trials if not trial.outcome.fell]
    nominal = problem.nominal.lumps.vector
    unknown = np.full(len(nominal), np.nan)
    determined = _determined(problem)
    factor = low = high = unknown
    if survivors:
        best = _last_best(survivors)
        # The paper's "range of possible values": trials that the measure cannot tell from the best.
        equal = np.array([t.factors for t in survivors if t.outcome.value <= best.outcome.value + problem.resolution])
        found = best.factors, equal.min(axis=0), equal.max(axis=0)
        factor, low, high = (np.where(determined, factors, np.nan) for factors in found)
    truth = problem.open_plant().true_lumps()
    true = unknown if truth is None else truth.vector
    identified = factor * nominal
    columns = {
        "name": problem.names,
        "unit": [lump_unit(lump) for lump in problem.names],
        "nominal": nominal,
        "factor": factor,
        "identified": identified,
        "low": low * nominal,
        "high": high * nominal,
        "true": true,
        "error": identified / true - 1.0,
        "determined": determined,
    }
    return pd.DataFrame(columns)


def _determined(problem: Problem) -> NDArray[np.bool_]:
    """Which lumps the trials can tell (nlump): by the sensitivity of the pushes for `spectral`, else by the measure."""
    if problem.measure.name == "spectral":
        return np.array(identifiability(problem).determined)
    return np.array([problem.measure.determines(lump) for lump in problem.names])


def best_trial(survivors: list[Trial]) -> Trial:
    """The survivor of least value, the first of equals."""
    return min(survivors, key=lambda trial: trial.outcome.value)


def _last_best(survivors: list[Trial]) -> Trial:
    """The survivor of least value, the last of equals: a search that went on among them had a reason to, as DINOIP,
    which ends just before the fall.
    """
    return best_trial(survivors[::-1])


def summary(store: Store, name: str) -> dict[str, Any]:
    """A study as `metaid study show --json` prints it; None where something is not known."""
    spec = stored_spec(store, name)
    problem = Problem(spec)
    trials = store.trials(name, problem.names)
    survivors = [trial for trial in trials if not trial.outcome.fell]
    lumps = _lumps(problem, trials)
    best = best_trial(survivors) if survivors else None
    states = [trial.state.name for trial in trials]
    errors = lumps["error"][lumps["determined"]].abs()
    return {
        "name": name,
        "plant": spec.plant_name,
        "sampler": spec.study.sampler,
        "measure": problem.measure.name,
        "seed": spec.study.seed,
        "trials": {
            "total": len(trials),
            "complete": len(survivors),
            "pruned": states.count("PRUNED"),
            "failed": states.count("FAIL"),
        },
        "best": {
            "number": best.number if best else None,
            "value": best.outcome.value if best else None,
            **_verified(problem, best),
        },
        "lumps": [_without_nan(row) for row in lumps.to_dict("records")],
        "max_error": None if errors.isna().any() else float(errors.max()),
    }


def _verified(problem: Problem, best: Trial | None) -> dict[str, Any]:
    """What MuJoCo says of the best candidate of a study that was screened by other physics; nothing for any other."""
    if problem.spec.study.episode.physics == "mujoco" or best is None:
        return {}
    outcome = problem.verify(best.factors)
    agrees = not outcome.fell and abs(outcome.value - best.outcome.value) <= problem.resolution
    return {"mujoco": {"value": outcome.value, "fell": outcome.fell, "agrees": agrees}}


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


def _without_nan(row: dict[Any, Any]) -> dict[str, Any]:
    return {str(key): None if isinstance(value, float) and np.isnan(value) else value for key, value in row.items()}
