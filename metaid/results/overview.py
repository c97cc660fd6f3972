"""What a study found, as the JSON of `study show`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from metaid.results.body_tables import parameters_of
from metaid.results.identified import lumps_of_stage
from metaid.results.stage import STATES, Stage, best_trial, stages
from metaid.store import Store, Trial
from metaid.study import Problem, StudySpec, stored_spec


def summary(store: Store, name: str) -> dict[str, Any]:
    """A study as `metaid study show --json` prints it; None where something is not known."""
    spec = stored_spec(store, name)
    trials = store.trials(name, *spec.names)
    by_stage = stages(spec, trials)
    lumps = pd.concat([lumps_of_stage(stage) for stage in by_stage], ignore_index=True)
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
        "lumps": [without_nan(row) for row in lumps.to_dict("records")],
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
    return {"parameters": [without_nan(row) for row in frame.to_dict("records")]}


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


def without_nan(row: dict[Any, Any]) -> dict[str, Any]:
    return {str(key): None if isinstance(value, float) and np.isnan(value) else value for key, value in row.items()}
