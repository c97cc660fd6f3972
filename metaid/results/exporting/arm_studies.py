"""The identified model of a study of an arm."""

from __future__ import annotations

from datetime import UTC, datetime

import pandas as pd

import metaid
from metaid.results.arms import ArmSnapshot, judge_arm
from metaid.results.exporting.dynamics import arm_dynamics
from metaid.results.exporting.identified import IdentifiedModel, no_model


def identified_arm(snapshot: ArmSnapshot, even_if_not_found: bool = False) -> IdentifiedModel:
    """What the study identified, or its last estimate where `even_if_not_found` asks for it.  Raises StudyError where
    there is none, and says why.
    """
    verdict, problem, found = judge_arm(snapshot), snapshot.problem, snapshot.estimate
    if found is None or not (verdict.is_found or even_if_not_found):
        raise no_model(snapshot.name, verdict, can_be_forced=found is not None)
    table = verdict.lumps.copy()
    table["value"] = verdict.values if verdict.is_found else found.estimate.values
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
        "misfit": found.estimate.misfit,
        "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "metaid": metaid.__version__,
    }
    names = table["name"].tolist()
    covariance = pd.DataFrame(found.estimate.value_covariance, index=names, columns=names)
    dynamics = arm_dynamics(problem.belief, table["value"].to_numpy())
    gravity = tuple(problem.nominal.gravity.tolist())
    return IdentifiedModel(snapshot.name, about, table, covariance, dynamics, gravity, problem.timestep)
