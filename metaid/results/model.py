"""The identified model of a study."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pandas as pd

import metaid
from metaid.errors import StudyError
from metaid.exporting import Dynamics, IdentifiedModel, arm_dynamics, chain_dynamics
from metaid.models import IDEAL, Array, kind_of
from metaid.plant import fault_unit
from metaid.results.snapshot import Snapshot, read_snapshot
from metaid.store import Store
from metaid.study import Problem, StudySpec, with_nominal

OF_FRICTION = {"damping": "viscous", "coulomb": "dry"}  # the fault that is of the same law


def identified_model(snapshot: Snapshot, even_if_not_found: bool = False) -> IdentifiedModel:
    """What a study identified; where its verdict is not `found`, and `even_if_not_found` asks for it, its last estimate
    or its best trial.  Raises StudyError where it identified nothing, and says why.
    """
    verdict, spec, found = snapshot.verdict, snapshot.spec, snapshot.estimate
    guess = None if verdict.has_result else _best_guess(snapshot)
    if not verdict.has_result and (guess is None or not even_if_not_found):
        how = " (--even-if-not-found, in Python even_if_not_found=True, gives what there is)"
        raise verdict.refusal(snapshot.name, "no identified model", "" if guess is None else how)
    table = verdict.lumps.assign(value=verdict.values if guess is None else guess)
    about = {
        **snapshot.head,
        "trials": len(snapshot.trials),
        "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "metaid": metaid.__version__,
    }
    stands = found if guess is None and verdict.source == "estimate" else None
    covariance = None
    if stands is not None and stands.estimate.counts is None:
        names = table["name"].tolist()
        covariance = pd.DataFrame(stands.value_covariance, index=names, columns=names)
    known = table["name"][table["identified"].notna()] if guess is None else table["name"]
    values = dict(zip(table["name"], table["value"].tolist(), strict=True))
    faults = None if stands is None else stands.estimate.faults
    beside = {} if faults is None else dict(zip(faults.searched.names, faults.values.tolist(), strict=True))
    dynamics = _dynamics(snapshot.problem, values, known.tolist(), beside)
    return IdentifiedModel(snapshot.name, about, table, covariance, dynamics, spec.gravity, spec.plant.timestep)


def started_from(store: Store, spec: StudySpec, other: str) -> StudySpec:
    """A study whose nominal model is what the study `other` in the DB identified.  Raises StorageError, and StudyError
    where that has identified nothing, or another kind of plant.
    """
    found = identified_model(read_snapshot(store, other))
    changed = with_nominal(spec, found.nominal)
    if found.gravity != spec.gravity:
        raise StudyError(
            f"study {spec.name}: its plant's gravity is {spec.gravity} m/s², that of study '{other}' {found.gravity}: "
            "they must agree, it is not searched"
        )
    return changed


def _best_guess(snapshot: Snapshot) -> Array | None:
    """The values (n) where nothing is found, in the order of the verdict's table: those of the last estimate, or of the
    best trial; None where there is neither.
    """
    if snapshot.verdict.source == "estimate":
        return None if snapshot.estimate is None else snapshot.estimate.estimate.values
    return None if snapshot.best is None else snapshot.problem.robot.sought.scale * snapshot.best.factors


def _dynamics(problem: Problem, values: dict[str, float], known: list[str], beside: dict[str, float]) -> Dynamics:
    """How a plant moves.

    Args:
        problem: of the study.
        values: that were identified, by name.
        known: the names of those that are not the nominal ones.
        beside: faults that were found, by name.
    """
    if problem.spec.is_arm:
        found = arm_dynamics(problem.arm.prior, np.array([values[name] for name in problem.names]))
        return _noting(found, beside, ())
    law = problem.chain.law_at(values)

    def of_joints(kind: str) -> Array:
        return np.array([beside.get(f"{kind}_{joint + 1}", 0.0) for joint in range(law.nlink)])

    damping, coulomb = (law.of(kind) + of_joints(fault) for kind, fault in OF_FRICTION.items())
    searched = IDEAL if law.inertia is None else (*IDEAL, "inertia")
    lumps = replace(law, damping=damping, coulomb=coulomb, searched=searched)
    is_known = np.isin(lumps.names, known)
    found = chain_dynamics(lumps, problem.spec.gravity, problem.nominal, is_known, of_joints("rotor"))
    return _noting(found, beside, ("rotor", *OF_FRICTION.values()))


def _noting(found: Dynamics, beside: dict[str, float], held: tuple[str, ...]) -> Dynamics:
    """The same with a note on what was found `beside` it and is not of a kind that it has `held`."""
    left = [f"{name} {value:.3g} {fault_unit(name)}" for name, value in beside.items() if kind_of(name) not in held]
    return replace(found, besides=f"found beside it, and not in it: {', '.join(left)}") if left else found
