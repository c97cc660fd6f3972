"""What a study found, as the JSON of `study show`."""

from __future__ import annotations

from typing import Any

import numpy as np

from metaid.frames import NO_ERROR, json_rows
from metaid.results.body_tables import body_rows
from metaid.results.candidates import identified_law, law_error
from metaid.results.lump_tables import fault_table, largest_error
from metaid.results.snapshot import Snapshot, counted_states, read_snapshot
from metaid.results.verdict import NUMBERS
from metaid.store import ForeignTrial, Store
from metaid.study.estimates import StudyEstimate

NOTHING = 1e-12  # kg m², kg m, m …: smaller numbers of a body are what rounding left
BEHIND = 0.005  # of half an interval, which is shown by two digits


def summary(store: Store, name: str, with_bodies: bool = False) -> dict[str, Any]:
    """A study as `metaid study show --json` prints it, and `with_bodies` as with `--bodies`; None where something is
    not known.
    """
    snapshot = read_snapshot(store, name)
    return {**summarized(snapshot), **(body_rows(snapshot) if with_bodies else {})}


def summarized(snapshot: Snapshot) -> dict[str, Any]:
    """The same of a study that has been read."""
    verdict, problem, found, best = snapshot.verdict, snapshot.problem, snapshot.estimate, snapshot.best
    return {
        **snapshot.head,
        "trials": counted_states(snapshot.trials),
        "best": {
            "number": best and best.number,
            "value": best and best.outcome.value,
            **_error_of_best(snapshot),
        },
        "lumps": json_rows(verdict.lumps),
        **fault_rows(snapshot),
        "max_error": largest_error(verdict.lumps),
        "model_error": law_error(problem, identified_law(snapshot)) if verdict.has_result else None,
        "periods": sum(sum(trial.outcome.periods) for trial in snapshot.survivors),
        "estimate": None if found is None else _estimate(found, verdict.word),
        "why_no_estimate": snapshot.why_no_estimate if found is None else None,
        **({"foreign_trials": [_foreign(trial, snapshot) for trial in snapshot.foreign]} if snapshot.foreign else {}),
        **({} if problem.noise_floor is None else {"noise_floor_hz": problem.noise_floor}),
    }


def shown_rows(shown: dict[str, Any], key: str = "lumps") -> list[dict[str, Any]]:
    """The rows of a summary's `lumps`, `faults` or `bodies` as tables show them: without numbers where nothing was
    found, and with 0 in place of what rounding left.
    """
    rows: list[dict[str, Any]] = shown.get(key) or []
    if shown["verdict"] == "not found":
        return [row | dict.fromkeys(row.keys() & NUMBERS) for row in rows]
    return [_without_rounding(row) for row in rows]


def _without_rounding(row: dict[str, Any]) -> dict[str, Any]:
    """A row of a table with 0 in place of numbers that are nothing in SI units, of errors that are none, and of an
    identified value whose digits are all behind those of half its interval.
    """
    low, high = row.get("low"), row.get("high")
    half = 0.0 if low is None or high is None else (high - low) / 2.0
    least = {"error": NO_ERROR, "identified": max(NOTHING, BEHIND * half)}

    def settled(key: str, value: Any) -> Any:
        return 0.0 if isinstance(value, float) and abs(value) < least.get(key, NOTHING) else value

    return {key: settled(key, value) for key, value in row.items()}


def fault_rows(snapshot: Snapshot) -> dict[str, Any]:
    """The table of faults as `study show --json` has it, under `faults`; nothing where no fault is ever searched."""
    if not snapshot.spec.study.estimate.faults:
        return {}
    return {"faults": json_rows(fault_table(snapshot, snapshot.verdict.has_result))}


def _estimate(found: StudyEstimate, verdict: str) -> dict[str, Any]:
    """How well the model explains what was seen, and what of; where the verdict asked pushes that were left out, what
    they say of it.
    """
    worth = found.approximation if verdict in ("approximate", "not found") else None
    return {
        "misfit": found.estimate.misfit,
        "explained_below": found.estimate.explained_below,
        "explains": found.explains,
        "description": found.description,
        "trials": found.trials,
        "counts": found.estimate.counts,
        "known_from": found.known_from,
        "half_width": found.half_width if found.explains else None,
        **_predicted(found),
        **_taken_up(found),
        **({} if worth is None else worth.summary()),
        **({"by_others": found.by_others} if found.by_others else {}),
    }


def _predicted(found: StudyEstimate) -> dict[str, float | None]:
    """The misfit of pushes that were held out, where the estimate explains all together; nothing where none was."""
    misfit = None if found.prediction is None else found.prediction.misfit
    return {} if misfit is None else {"misfit_held_out": misfit if np.isfinite(misfit) else None}


def _taken_up(found: StudyEstimate) -> dict[str, Any]:
    """Which faults the study took up by itself, and what speaks for them; nothing where it took up none."""
    taken = found.taken_up
    if taken is None:
        return {}
    shown = {
        "faults": list(taken.kinds),
        "misfit_without": taken.before if np.isfinite(taken.before) else None,
        "rivals": list(taken.rivals),
    }
    return {"taken_up": shown}


def _foreign(trial: ForeignTrial, snapshot: Snapshot) -> dict[str, Any]:
    """A trial of others; with its value where `metaid.objective` evaluated it with the settings of this study."""
    is_evaluated = trial.experiment == snapshot.spec.experiment
    return {"number": trial.number, "state": trial.state, **({"value": trial.value} if is_evaluated else {})}


def _error_of_best(snapshot: Snapshot) -> dict[str, float | None]:
    """The largest error of the best trial itself, where the study stands by the estimate from all trials."""
    problem, wanted, best = snapshot.problem, snapshot.problem.robot.sought, snapshot.best
    if snapshot.verdict.source == "best trial" or problem.is_matching or best is None or wanted.deviations is not None:
        return {}
    true = problem.robot.true_values(wanted)
    if np.isnan(true).all():
        return {}
    errors = np.abs(wanted.scale * best.factors / np.where(true == 0.0, np.nan, true) - 1.0)
    return {"max_error": None if np.isnan(errors).any() else float(errors.max())}
