"""The identified model of a study of a planar chain."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

import metaid
from metaid.errors import StudyError
from metaid.models import IDEAL, Array, Lumps, kind_of
from metaid.results.exporting.dynamics import chain_dynamics
from metaid.results.exporting.identified import IdentifiedModel, covariance_frame
from metaid.results.snapshot import Snapshot
from metaid.results.verdict import judge

EQUAL = 1.0  # the deviation of a log of a lump whose own is not known: then all count alike


def identified_chain(snapshot: Snapshot) -> IdentifiedModel:
    """What the study identified.  Raises StudyError where it identified nothing, and says why."""
    verdict, problem = judge(snapshot), snapshot.first
    if not verdict.is_found:
        why = "; ".join(verdict.reasons)
        raise StudyError(f"study '{snapshot.name}' has no model to write: its verdict is '{verdict.word}': {why}")
    table = verdict.lumps.copy()
    table["value"] = table["identified"].where(table["determined"], table["nominal"])
    lumps = _lumps_of(dict(zip(table["name"], table["value"], strict=True)), problem.nominal.lumps_of(IDEAL))
    names = lumps.names
    known = np.isin(names, table["name"][table["determined"]])
    relative, covariance = EQUAL**2 * np.eye(len(names)), None
    found = snapshot.estimate
    if verdict.source == "estimate" and found is not None and found.estimate.counts is None:
        estimate = found.estimate
        # With exact lengths Coriolis lumps follow from gravity lumps, and are not in the covariance.
        known &= np.isin(names, estimate.names)
        relative = _covariance_of(names, known, list(estimate.names), estimate.covariance)
        values = table.set_index("name")["value"][list(estimate.names)].to_numpy()
        covariance = covariance_frame(list(estimate.names), values, estimate.covariance)
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
    dynamics = chain_dynamics(lumps, plant.gravity, problem.nominal, known, relative)
    return IdentifiedModel(snapshot.name, about, table, covariance, dynamics, plant.gravity, plant.timestep)


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


def _covariance_of(names: list[str], known: NDArray[np.bool_], estimated: list[str], covariance: Array) -> Array:
    """The covariance of the lumps of these `names` (nlump x nlump) from that of those that were `estimated`; lumps that
    are not `known` have that of the prior, whatever it is: they do not count.
    """
    matrix = EQUAL**2 * np.eye(len(names))
    at = [estimated.index(name) for name, is_known in zip(names, known, strict=True) if is_known]
    matrix[np.ix_(known, known)] = covariance[np.ix_(at, at)]
    return matrix
