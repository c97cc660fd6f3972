"""The identified model of a study of an arm."""

from __future__ import annotations

from datetime import UTC, datetime

import pandas as pd

import metaid
from metaid.models import Array
from metaid.results.arms import ArmSnapshot, judge_arm
from metaid.results.exporting.dynamics import arm_dynamics
from metaid.results.exporting.identified import IdentifiedModel, no_model
from metaid.results.verdict import Verdict


def identified_arm(snapshot: ArmSnapshot, even_if_not_found: bool = False) -> IdentifiedModel:
    """What the study identified, or, where `even_if_not_found` asks for it, its last estimate or best trial.  Raises
    StudyError where there is none, and says why.
    """
    verdict, problem, found = judge_arm(snapshot), snapshot.problem, snapshot.estimate
    if verdict.source == "best trial":
        found = None
    values = verdict.values if verdict.has_result else _best_guess(snapshot, verdict)
    if values is None or not (verdict.has_result or even_if_not_found):
        raise no_model(snapshot.name, verdict, can_be_forced=values is not None)
    table = verdict.lumps.assign(value=values)
    spec = snapshot.spec
    about = {
        "plant": spec.plant_name,
        "sampler": spec.study.sampler,
        "measure": problem.measure.name,
        "seed": spec.study.seed,
        "trials": len(snapshot.trials),
        "verdict": verdict.word,
        "reasons": list(verdict.reasons),
        "source": verdict.source,
        "misfit": None if snapshot.estimate is None else snapshot.estimate.estimate.misfit,
        "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "metaid": metaid.__version__,
    }
    names = table["name"].tolist()
    covariance = None
    if found is not None:
        own = found.covariance if verdict.has_result else found.estimate.value_covariance
        covariance = pd.DataFrame(own, index=names, columns=names)
    dynamics = arm_dynamics(problem.prior, values)
    gravity = tuple(problem.nominal.gravity.tolist())
    return IdentifiedModel(snapshot.name, about, table, covariance, dynamics, gravity, problem.timestep)


def _best_guess(snapshot: ArmSnapshot, verdict: Verdict) -> Array | None:
    """The base parameters (nbase) of the last estimate, or of the best trial, where nothing is found; None where there
    is neither.
    """
    if verdict.source == "estimate":
        return None if snapshot.estimate is None else snapshot.estimate.estimate.values
    return None if snapshot.best is None else snapshot.best.factors
