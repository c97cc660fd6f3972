"""Whether a study of an arm has found its base parameters, and all of it as the JSON of `study show`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from metaid.models import Array
from metaid.models.tree import model_error
from metaid.results.arms.arm_snapshot import ArmSnapshot
from metaid.results.arms.arm_tables import base_table
from metaid.results.lump_tables import without_nan
from metaid.results.snapshot import counted_states
from metaid.results.verdict import Verdict, missed, not_yet
from metaid.study import COARSEST


def judge_arm(snapshot: ArmSnapshot) -> Verdict:
    """The verdict on a study as it is in the DB: that on its estimate."""
    found, table = snapshot.estimate, base_table(snapshot)
    if found is not None and found.explains and table["determined"].any():
        return Verdict("found", "estimate", tuple(missed(table, "these trials do")), table)
    if found is None:
        why = "no arm near the nominal one shows what the trials showed" if snapshot.trials else "it has no trial yet"
    elif found.explains:
        why = f"the trials show no base parameter to better than {COARSEST:.0%}: push more, or faster"
    else:
        why = found.description
    done = len(snapshot.trials), snapshot.spec.study.trials
    return not_yet(snapshot.is_finished, done, "estimate", (why,), table)


def arm_summary(snapshot: ArmSnapshot, verdict: Verdict) -> dict[str, Any]:
    """A study as `metaid study show --json` prints it; None where something is not known."""
    spec, problem, found = snapshot.spec, snapshot.problem, snapshot.estimate
    estimate = None
    if found is not None:
        estimate = {
            "misfit": found.estimate.misfit,
            "explained_below": found.estimate.explained_below,
            "explains": found.explains,
            "description": found.description,
            "trials": found.trials,
            "counts": None,
            "known_from": found.known_from,
        }
    survivors = [trial for trial in snapshot.trials if not trial.outcome.fell]
    best = min(survivors, key=lambda trial: trial.outcome.value, default=None)
    return {
        "name": snapshot.name,
        "plant": spec.plant_name,
        "sampler": spec.study.sampler,
        "measure": problem.measure.name,
        "seed": spec.study.seed,
        "verdict": verdict.word,
        "reasons": list(verdict.reasons),
        "source": verdict.source,
        "misfit": None if found is None else found.estimate.misfit,
        "trials": counted_states(snapshot.trials),
        "best": {"number": best and best.number, "value": best and best.outcome.value},
        "lumps": [without_nan(row) for row in verdict.lumps.to_dict("records")],
        "max_error": None,
        "model_error": _model_error(snapshot, verdict),
        "periods": 0,
        "estimate": estimate,
        "why_no_estimate": None if found is not None else "; ".join(verdict.reasons),
    }


def _model_error(snapshot: ArmSnapshot, verdict: Verdict) -> dict[str, float] | None:
    """How wrong the identified arm is on states that no trial has seen; None where nothing was found, or the truth is
    not known.
    """
    if snapshot.truth is None or not verdict.is_found:
        return None
    return asdict(model_error(snapshot.truth, identified_parameters(snapshot, verdict)))


def identified_parameters(snapshot: ArmSnapshot, verdict: Verdict) -> Array:
    """Parameters of the identified arm (njoint x 13), the most probable that have its base parameters. A base parameter
    that is not determined keeps its nominal value.
    """
    return snapshot.problem.belief.parameters_at(verdict.values)
