"""The model that a log has told, to be written to files that are used elsewhere."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pandas as pd

import metaid
from metaid.errors import RecordError
from metaid.models import IDEAL, kind_of
from metaid.models.tree import Belief
from metaid.recorded.estimate import RecordedEstimate
from metaid.recorded.judging import RecordedVerdict
from metaid.recorded.log import Record
from metaid.results.exporting import IdentifiedModel, arm_dynamics, chain_dynamics

KNOWN_FRICTION = {"viscous", "coulomb", "offset"}  # terms beside which viscous and dry friction mean what they say


def recorded_identified_model(
    record: Record, plant: str, found: RecordedEstimate, verdict: RecordedVerdict
) -> IdentifiedModel:
    """What a log has told.  Raises RecordError where it has told nothing, and says why.

    Args:
        record: the log.
        plant: the name of the nominal plant.
        found: what the log says.
        verdict: on it.
    """
    if not verdict.is_found:
        raise RecordError(f"{record.name}: no model to write: the verdict is '{verdict.word}'")
    table = verdict.lumps.copy()
    table["value"] = table["identified"].where(table["determined"], table["nominal"].fillna(0.0))
    values = dict(zip(table["name"], table["value"], strict=True))
    model = found.model
    keeps_friction = set(model.friction) <= KNOWN_FRICTION and not model.coupled
    reasons = list(verdict.reasons)
    if model.friction and not keeps_friction:
        reasons.append("friction is in the .json alone: no other file has all of its terms")
    elif "offset" in model.friction:
        reasons.append("offsets of torques are in the .json alone")
    about = {
        "plant": plant,
        "rows": len(record.times),
        "verdict": verdict.word,
        "reasons": reasons,
        "source": "estimate",
        "misfit": None,
        "delay_s": found.delay,
        "held_out_error": found.error,
        "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "metaid": metaid.__version__,
    }
    names = table["name"][table["determined"]].tolist()
    at = np.flatnonzero(table["determined"].to_numpy())
    covariance = pd.DataFrame(found.covariance[np.ix_(at, at)], index=names, columns=names)
    gravity: float | tuple[float, ...]
    if isinstance(model.source, Belief):
        belief = model.source
        kept = belief.values.copy()
        for place, (name, column) in enumerate(zip(belief.base.names, belief.base.columns, strict=True)):
            is_friction = column % 13 > 10
            kept[place] = values.get(name, 0.0) if keeps_friction or not is_friction else 0.0
        dynamics = arm_dynamics(belief, kept)
        gravity = tuple(belief.nominal.gravity.tolist())
    else:
        chain, gravity = model.source
        kinds = (*IDEAL, "inertia")
        friction = tuple(
            kind for kind in ("damping", "coulomb") if keeps_friction and any(kind_of(name) == kind for name in values)
        )
        lumps = chain.lumps_of((*kinds, *friction))
        lumps = lumps.with_parameters(np.array([values[name] for name in lumps.names]))
        known = table["determined"].to_numpy()[: model.nbody]
        nominal = table["value"].to_numpy()[: model.nbody]
        relative = found.covariance[: model.nbody, : model.nbody] / np.outer(nominal, nominal)
        relative = np.where(np.outer(known, known), relative, np.eye(len(known)))
        dynamics = chain_dynamics(lumps, gravity, chain, known, relative)
    return IdentifiedModel(record.name, about, table, covariance, dynamics, gravity, record.period)
