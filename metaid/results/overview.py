"""What a study found, as the JSON of `study show`."""

from __future__ import annotations

from typing import Any

import numpy as np

from metaid.errors import StudyError
from metaid.results.arms import ArmSnapshot, arm_summary, judge_any, read_any_snapshot
from metaid.results.best import best_trial
from metaid.results.body_tables import body_rows
from metaid.results.estimates import approximation_rows, why_no_estimate
from metaid.results.lump_tables import fault_rows, largest_error, without_nan
from metaid.results.snapshot import Snapshot, counted_states
from metaid.results.verdict import NUMBERS, Verdict
from metaid.store import ForeignTrial, Store
from metaid.study import Problem
from metaid.study.estimates import ChainFound


def summary(store: Store, name: str, with_bodies: bool = False) -> dict[str, Any]:
    """A study as `metaid study show --json` prints it, and `with_bodies` as with `--bodies`; None where something is
    not known.
    """
    snapshot = read_any_snapshot(store, name)
    verdict = judge_any(snapshot)
    if isinstance(snapshot, ArmSnapshot):
        if with_bodies:
            raise StudyError(f"study '{name}' is of an arm: which bodies it may have is known of chains only")
        return arm_summary(snapshot, verdict)
    bodies = body_rows(snapshot.problem, snapshot.estimate, verdict) if with_bodies else {}
    return {**summarized(snapshot, verdict), **bodies}


def summarized(snapshot: Snapshot, verdict: Verdict) -> dict[str, Any]:
    """The same of a study of a chain that has been read, and the `verdict` on it."""
    spec, problem = snapshot.spec, snapshot.problem
    return {
        "name": snapshot.name,
        "plant": spec.plant_name,
        "sampler": spec.study.sampler,
        "measure": problem.measure.name,
        "seed": spec.study.seed,
        "verdict": verdict.word,
        "reasons": list(verdict.reasons),
        "source": verdict.source,
        "misfit": None if snapshot.estimate is None else snapshot.estimate.estimate.misfit,
        "trials": counted_states(snapshot.trials),
        "best": {**_best(snapshot), **_error_of_best(snapshot, verdict)},
        "lumps": [without_nan(row) for row in verdict.lumps.to_dict("records")],
        **fault_rows(problem, snapshot.estimate, verdict.has_result),
        "max_error": largest_error(verdict.lumps),
        "model_error": None,
        "periods": sum(sum(trial.outcome.periods) for trial in snapshot.survivors),
        **_estimate(snapshot, verdict),
        **({"foreign_trials": [_foreign(trial, snapshot) for trial in snapshot.foreign]} if snapshot.foreign else {}),
        **_noise_floor(problem),
    }


def shown_rows(shown: dict[str, Any], key: str = "lumps") -> list[dict[str, Any]]:
    """The rows of a summary's `lumps` or `faults` as tables show them: without numbers where nothing was found."""
    rows: list[dict[str, Any]] = shown.get(key, [])
    return [row | dict.fromkeys(row.keys() & NUMBERS) for row in rows] if shown["verdict"] == "not found" else rows


def _estimate(snapshot: Snapshot, verdict: Verdict) -> dict[str, Any]:
    """How well the model explains what was seen, and what of; where there is no estimate, why."""
    problem, found = snapshot.problem, snapshot.estimate
    if found is None:
        why = why_no_estimate(problem, snapshot.all_shown)
        return {"estimate": None, "why_no_estimate": why}
    estimate = {
        "misfit": found.estimate.misfit,
        "explained_below": found.estimate.explained_below,
        "explains": found.explains,
        "description": found.description,
        "trials": found.trials,
        "counts": found.estimate.counts,
        "known_from": found.known_from,
        "half_width": found.half_width if found.explains else None,
        **_taken_up(found),
        **approximation_rows(found, verdict.word),
        **({"by_others": found.by_others} if found.by_others else {}),
    }
    return {"estimate": estimate, "why_no_estimate": None}


def _taken_up(found: ChainFound) -> dict[str, Any]:
    """Which faults the study took up by itself, and what speaks for them; nothing where it took up none."""
    taken = found.taken_up
    if taken is None:
        return {}
    shown = {
        "faults": list(taken.kinds),
        "misfit_without": taken.before if np.isfinite(taken.before) else None,
        "misfit_held_out": taken.predicted if np.isfinite(taken.predicted) else None,
        "holds": taken.holds,
        "rivals": list(taken.rivals),
    }
    return {"taken_up": shown}


def _foreign(trial: ForeignTrial, snapshot: Snapshot) -> dict[str, Any]:
    """A trial of others; with its value where `metaid.objective` evaluated it with the settings of this study."""
    is_evaluated = trial.experiment == snapshot.spec.experiment
    return {"number": trial.number, "state": trial.state, **({"value": trial.value} if is_evaluated else {})}


def _error_of_best(snapshot: Snapshot, verdict: Verdict) -> dict[str, float | None]:
    """The largest error of the best trial itself, where the study stands by the estimate from all trials."""
    problem, truth = snapshot.problem, snapshot.problem.open_plant().true_lumps()
    if verdict.source == "best trial" or problem.is_matching or not snapshot.survivors or truth is None:
        return {}
    true = truth.vector_of(problem.lumps.searched, np.nan)
    errors = np.abs(
        best_trial(snapshot.survivors).factors * problem.lumps.vector / np.where(true == 0.0, np.nan, true) - 1
    )
    return {"max_error": None if np.isnan(errors).any() else float(errors.max())}


def _noise_floor(problem: Problem) -> dict[str, float]:
    return {"noise_floor_hz": problem.episode.noise_floor.frequency} if problem.measure.is_noisy else {}


def _best(snapshot: Snapshot) -> dict[str, Any]:
    survivors = snapshot.survivors
    if not survivors:
        return {"number": None, "value": None}
    best = best_trial(survivors)
    return {"number": best.number, "value": best.outcome.value}
