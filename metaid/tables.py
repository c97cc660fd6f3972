"""What a study found, as pandas frames and as the JSON of `study show`. Here, and only here, the truth meets the
result.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.body_tables import parameters_of
from metaid.chain import Array, lump_unit
from metaid.errors import StudyError
from metaid.identifiability import identifiability
from metaid.problem import Problem
from metaid.rows import Trial
from metaid.spec import StudySpec
from metaid.store import Store
from metaid.study import stored_spec

STATES = ["COMPLETE", "PRUNED", "FAIL"]


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
    for searched, own in zip(spec.names, _by_stage(spec, trials), strict=True):
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
    return pd.concat([_lumps(stage) for stage in stages(spec, store.trials(name, *spec.names))], ignore_index=True)


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
    by_stage = _by_stage(spec, trials)
    survivors = [trial for trial in by_stage[0] if not trial.outcome.fell]
    first = Problem(spec)
    if first.body_space is not None:
        return [Stage(first, [replace(trial, factors=first.lump_factors(trial.factors)) for trial in trials])]
    problems = first.stages(best_trial(survivors).factors if survivors else None)
    return [Stage(problem, own) for problem, own in zip(problems, by_stage, strict=True)]


def _by_stage(spec: StudySpec, trials: list[Trial]) -> list[list[Trial]]:
    return [[trial for trial in trials if trial.stage in (None, i + 1)] for i in range(len(spec.names))]


def _lumps(stage: Stage) -> pd.DataFrame:
    problem, survivors = stage.problem, stage.survivors
    nominal = problem.lumps.vector
    unknown = np.full(len(nominal), np.nan)
    determined = _determined(problem)
    factor = low = high = unknown
    if survivors:
        factors = np.array([trial.factors for trial in survivors])
        values = np.array([trial.outcome.value for trial in survivors])
        found = identified_factors(problem, factors, values)
        factor, low, high = (np.where(determined, factors, np.nan) for factors in found)
    truth = problem.open_plant().true_lumps()
    true = unknown if truth is None else truth.vector_of(problem.lumps.searched, np.nan)
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
        "error": identified / np.where(true == 0.0, np.nan, true) - 1.0,
        "determined": determined,
    }
    return pd.DataFrame(columns)


def identified_factors(problem: Problem, factors: Array, values: Array) -> tuple[Array, Array, Array]:
    """What survivors with these `factors` (ntrial x nlump) and `values` (ntrial) say of each lump's factor: the one to
    stand by, and the least and largest possible, (nlump) each.
    """
    # The last of equals: a search that went on among them had a reason to, as DINOIP, which ends just before the fall.
    best = len(values) - 1 - int(values[::-1].argmin())
    # The paper's "range of possible values": trials that the measure cannot tell from the best.
    equal = factors[values <= problem.as_good_as(float(values[best]))]
    told = equal.mean(axis=0) if problem.measure.is_noisy else factors[best]
    return told, equal.min(axis=0), equal.max(axis=0)


def _determined(problem: Problem) -> NDArray[np.bool_]:
    """Which lumps the trials can tell (nlump): by the sensitivity of the pushes, else by the measure."""
    if problem.measure.sees_coriolis:
        return np.array(identifiability(problem).determined)
    return np.array([problem.measure.determines(lump) for lump in problem.names])


def best_trial(survivors: list[Trial]) -> Trial:
    """The survivor of least value, the first of equals."""
    return min(survivors, key=lambda trial: trial.outcome.value)


def summary(store: Store, name: str) -> dict[str, Any]:
    """A study as `metaid study show --json` prints it; None where something is not known."""
    spec = stored_spec(store, name)
    trials = store.trials(name, *spec.names)
    by_stage = stages(spec, trials)
    lumps = pd.concat([_lumps(stage) for stage in by_stage], ignore_index=True)
    errors = lumps["error"][lumps["determined"]].abs()
    return {
        "name": name,
        "plant": spec.plant_name,
        "sampler": spec.study.sampler,
        "measure": by_stage[0].problem.measure.name,
        "seed": spec.study.seed,
        "trials": _counts(trials),
        "best": _best(by_stage[0]),
        **_noise_floor(by_stage[0].problem),
        "lumps": [_without_nan(row) for row in lumps.to_dict("records")],
        "max_error": None if errors.isna().any() else float(errors.max()),
        **_parameters(spec, trials),
        **({"stages": [_stage_summary(stage) for stage in by_stage]} if len(by_stage) > 1 else {}),
    }


def _noise_floor(problem: Problem) -> dict[str, float]:
    return {"noise_floor_hz": problem.episode.noise_floor.frequency} if problem.measure.is_noisy else {}


def _parameters(spec: StudySpec, trials: list[Trial]) -> dict[str, Any]:
    """What is known of individual parameters, and how far the lumps of all those bodies agree; nothing for a search of
    lumps.
    """
    if spec.study.search.space == "lumps":
        return {}
    frame = parameters_of(Problem(spec), trials)
    return {"parameters": [_without_nan(row) for row in frame.to_dict("records")]}


def parameters_frame(store: Store, name: str) -> pd.DataFrame:
    """One row a parameter of a study that searches individual ones: `name`, `unit`, `nominal`, its range `low` to
    `high` over the bodies that are as good as the best, `true` where the plant knows it, and how many `bodies` these
    are.  Raises StudyError of another study.
    """
    spec = stored_spec(store, name)
    if spec.study.search.space == "lumps":
        raise StudyError(f"study '{name}' searches lumps (allowed: one with search.space = 'parameters')")
    return parameters_of(Problem(spec), store.trials(name, *spec.names))


def _stage_summary(stage: Stage) -> dict[str, Any]:
    searched = list(stage.problem.lumps.searched)
    return {"stage": stage.problem.stage, "searched": searched, "trials": _counts(stage.trials), "best": _best(stage)}


def _counts(trials: list[Trial]) -> dict[str, int]:
    states = [trial.state.name for trial in trials]
    counts = {kind: states.count(state) for kind, state in zip(("complete", "pruned", "failed"), STATES, strict=True)}
    return {"total": len(trials), **counts}


def _best(stage: Stage) -> dict[str, Any]:
    survivors = stage.survivors
    if not survivors:
        return {"number": None, "value": None}
    best = best_trial(survivors)
    return {"number": best.number, "value": best.outcome.value, **_verified(stage.problem, best)}


def _verified(problem: Problem, best: Trial) -> dict[str, Any]:
    """What MuJoCo says of the best candidate of a study that was screened by other physics; nothing for any other."""
    if problem.spec.study.episode.physics == "mujoco":
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
