"""The identified model of a study of an arm."""

from __future__ import annotations

from datetime import UTC, datetime

import pandas as pd

import metaid
from metaid.errors import StudyError
from metaid.results.arms import ArmSnapshot, judge_arm
from metaid.results.exporting.dynamics import arm_dynamics
from metaid.results.exporting.identified import IdentifiedModel


def identified_arm(snapshot: ArmSnapshot) -> IdentifiedModel:
    """What the study identified.  Raises StudyError where it identified nothing, and says why."""
    verdict, problem, found = judge_arm(snapshot), snapshot.problem, snapshot.estimate
    if not verdict.is_found or found is None:
        why = "; ".join(verdict.reasons)
        raise StudyError(f"study '{snapshot.name}' has no model to write: its verdict is '{verdict.word}': {why}")
    table = verdict.lumps.copy()
    table["value"] = table["identified"].where(table["determined"], table["nominal"])
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
