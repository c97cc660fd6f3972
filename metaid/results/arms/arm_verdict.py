"""Whether a study of an arm has found its base parameters, and all of it as the JSON of `study show`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import pandas as pd

from metaid.models import Array
from metaid.models.tree import model_error
from metaid.results.arms.arm_snapshot import ArmSnapshot
from metaid.results.arms.arm_tables import best_table, estimate_table
from metaid.results.estimates import approximation_rows
from metaid.results.lump_tables import without_nan
from metaid.results.snapshot import counted_states
from metaid.results.verdict import FAR, Source, Verdict, missed, not_yet
from metaid.study import COARSEST


def judge_arm(snapshot: ArmSnapshot) -> Verdict:
    """The verdict on a study as it is in the DB: that on its estimate, and where the sampler does without one and none
    explains the trials, that on its best trial.
    """
    found = snapshot.estimate
    explains = found is not None and found.explains
    table = estimate_table(snapshot, explains)
    if explains and table["determined"].any():
        return Verdict("found", "estimate", tuple(missed(table, "these trials do")), table)
    if found is None:
        why = snapshot.why_no_estimate
    elif found.explains:
        why = f"the trials show no base parameter to better than {COARSEST:.0%}: push more, or faster"
    else:
        why = found.description
    done = len(snapshot.trials), snapshot.spec.study.trials
    if snapshot.problem.is_matching or explains:
        source: Source = "estimate"
        against: tuple[str, ...] = (why,)
    else:
        table, source = best_table(snapshot), "best trial"
        against = tuple(_against_best(snapshot, table))
        if not against:
            missing = tuple(missed(table, f"{snapshot.problem.measure.name} alone does"))
            return Verdict("found", source, missing, table)
    worth = found.approximation if found is not None and snapshot.is_finished else None
    if found is None or worth is None:
        return not_yet(snapshot.is_finished, done, source, against, table)
    if not worth.holds:
        return not_yet(True, done, source, (*against, worth.why_not), table)
    table = estimate_table(snapshot, is_result=True)
    missing = tuple(missed(table, "these trials do"))
    said = (worth.predicted, worth.not_explained, *missing, found.description)
    return Verdict("approximate", "estimate", said, table)


def _against_best(snapshot: ArmSnapshot, table: pd.DataFrame) -> Iterator[str]:
    """What speaks against taking the best trial for the result."""
    problem, best, found = snapshot.problem, snapshot.best, snapshot.estimate
    if best is None:
        yield "a push fell in every trial: begin nearer, or slower" if snapshot.trials else snapshot.why_no_estimate
        return
    value, resolution, measure = best.outcome.value, problem.resolution, problem.measure
    if value > FAR * resolution:
        yield (
            f"the best value, {value:.3g} {measure.unit}, is {value / resolution:.3g} times the {resolution:.2g} "
            f"{measure.unit} that {measure.name} can tell from none: try more trials, another seed or another sampler; "
            "with dry friction, or noise, no law comes so near"
        )
        if found is not None:
            yield found.description
    elif not table["determined"].any():
        yield f"{measure.name} determines no base parameter to better than {COARSEST:.0%}"


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
            **approximation_rows(found, verdict.word),
        }
    best = snapshot.best
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
        "why_no_estimate": None if found is not None else snapshot.why_no_estimate,
    }


def _model_error(snapshot: ArmSnapshot, verdict: Verdict) -> dict[str, float] | None:
    """How wrong the identified arm is on states that no trial has seen; None where nothing was found, or the truth is
    not known.
    """
    if snapshot.truth is None or not verdict.has_result:
        return None
    return asdict(model_error(snapshot.truth, identified_parameters(snapshot, verdict)))


def identified_parameters(snapshot: ArmSnapshot, verdict: Verdict) -> Array:
    """Parameters of the identified arm (njoint x 13), the most probable that have its base parameters."""
    return snapshot.problem.prior.parameters_at(verdict.values)


def laws(snapshot: ArmSnapshot, verdict: Verdict) -> dict[str, Array]:
    """Parameters of laws that are compared (njoint x 13 each), by name: of the nominal arm, the identified one, and the
    true one where it is known. Where nothing was found there is the best trial's in place of the identified one, if any
    trial did not fall.
    """
    problem = snapshot.problem
    found = {"nominal": problem.nominal.parameters}
    if verdict.has_result:
        found["identified"] = identified_parameters(snapshot, verdict)
    elif snapshot.best is not None:
        found["best trial"] = problem.prior.parameters_at(snapshot.best.factors)
    return found if snapshot.truth is None else {**found, "true": snapshot.truth.parameters}
