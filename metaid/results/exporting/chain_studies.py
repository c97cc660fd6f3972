"""The identified model of a study of a planar chain."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

import metaid
from metaid.models import IDEAL, Array, Lumps, kind_of
from metaid.results.best import best_trial
from metaid.results.exporting.dynamics import chain_dynamics
from metaid.results.exporting.identified import IdentifiedModel, covariance_frame, no_model
from metaid.results.snapshot import Snapshot
from metaid.results.verdict import Verdict, judge


def identified_chain(snapshot: Snapshot, even_if_not_found: bool = False) -> IdentifiedModel:
    """What the study identified, or, where `even_if_not_found` asks for it, its last estimate or best trial.  Raises
    StudyError where there is none, and says why.
    """
    verdict, problem = judge(snapshot), snapshot.problem
    guess = None if verdict.has_result else _best_guess(snapshot, verdict)
    if not verdict.has_result and (guess is None or not even_if_not_found):
        raise no_model(snapshot.name, verdict, can_be_forced=guess is not None)
    table = verdict.lumps.copy()
    table["value"] = verdict.values if guess is None else guess
    lumps = _lumps_of(dict(zip(table["name"], table["value"], strict=True)), problem.nominal.lumps_of(IDEAL))
    names = lumps.names
    known = np.isin(names, table["name"][table["identified"].notna()] if guess is None else table["name"])
    covariance, found = None, snapshot.estimate
    if guess is None and verdict.source == "estimate" and found is not None:
        estimated = list(found.estimate.lump_names)
        values = table.set_index("name")["value"][estimated].to_numpy()
        if found.estimate.counts is None:
            covariance = covariance_frame(estimated, values, found.lump_covariance)
    plant = snapshot.spec.plant
    about = {
        "plant": snapshot.spec.plant_name,
        "sampler": snapshot.spec.study.sampler,
        "measure": problem.measure.name,
        "seed": snapshot.spec.study.seed,
        "trials": len(snapshot.trials),
        "verdict": verdict.word,
        "reasons": list(verdict.reasons),
        "source": verdict.source,
        "misfit": None if found is None else found.estimate.misfit,
        "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "metaid": metaid.__version__,
    }
    dynamics = chain_dynamics(lumps, plant.gravity, problem.nominal, known)
    return IdentifiedModel(snapshot.name, about, table, covariance, dynamics, plant.gravity, plant.timestep)


def _best_guess(snapshot: Snapshot, verdict: Verdict) -> Array | None:
    """The values of the lumps (nlump) where nothing is found, in the order of the verdict's table: those of the last
    estimate, or of the best trial; None where there is neither.
    """
    nominal: Array = verdict.lumps["nominal"].to_numpy()
    if verdict.source == "estimate":
        found = snapshot.estimate
        return None if found is None else found.estimate.lumps.vector_of(snapshot.problem.estimated_kinds)
    survivors = snapshot.survivors
    return np.asarray(nominal * best_trial(survivors).factors, dtype=np.float64) if survivors else None


def _lumps_of(values: dict[str, float], nominal: Lumps) -> Lumps:
    """Lumps with these `values` by name. Gravity and Coriolis lumps that have none are the nominal ones; inertia lumps
    and friction that have none are left out.
    """
    kinds = dict.fromkeys((*IDEAL, *map(kind_of, values)))
    searched = tuple(kind for kind in (*IDEAL, "inertia") if kind in kinds)
    parts = {kind: nominal.gravity for kind in kinds if kind not in IDEAL}
    shaped = Lumps(nominal.gravity, nominal.coriolis, **parts, searched=tuple(kinds))
    vector = [values.get(name, usual) for name, usual in zip(shaped.names, shaped.vector.tolist(), strict=True)]
    filled = shaped.with_parameters(np.array(vector))
    return Lumps(**{kind: getattr(filled, kind) for kind in kinds}, searched=searched)
