"""By which factor the torques of each joint differ from what the nominal bodies need: units, currents, signs."""

from __future__ import annotations

import numpy as np

from metaid.models import Array
from metaid.recorded.weak_form.equations import Equations

KNOWN = 4.0  # deviations from nothing: a factor that is less sure is not known
FAR = 2.0  # a factor of all torques that is farther from 1 is taken for another unit
CORRELATED = 6.0  # rows that say as much as one, for errors last
EXPLAINS = 0.5  # of what friction leaves of a joint's torque, squared: bodies that explain less tell no factor
BESIDE = ("viscous", "coulomb", "offset")


def joint_scales(equations: Equations) -> Array:
    """The factor of each joint (njoint), beside friction that is fitted; NaN where the joint does not tell."""
    model = equations.model
    scales = np.full(model.njoint, np.nan)
    rows = equations.solved[1]
    for joint in np.flatnonzero(~model.untrusted).tolist():
        own = np.concatenate([each[:, :, joint].reshape(-1, each.shape[-1]) for each in rows])
        sent = np.concatenate([torques[:, :, joint].ravel() for torques in equations.torques])
        columns = [own[:, : model.nbody] @ model.nominal]
        columns += [own[:, model.column(term, joint)] for term in BESIDE if term in model.friction]
        stacked = np.stack(columns, axis=1)
        rubbing = stacked[:, 1:] @ np.linalg.lstsq(stacked[:, 1:], sent, rcond=1e-10)[0]
        size = np.sqrt((stacked**2).sum(axis=0))
        unit = stacked / np.where(size > 0.0, size, 1.0)
        inverse = np.linalg.pinv(unit.T @ unit, rcond=1e-10, hermitian=True)
        solved = inverse @ (unit.T @ sent)
        left, by_friction = (float(((sent - each) ** 2).sum()) for each in (unit @ solved, rubbing))
        variance = left / max(len(sent) / CORRELATED - unit.shape[1], 1.0) * inverse[0, 0]
        if left < (1.0 - EXPLAINS) * by_friction and abs(solved[0]) > KNOWN * np.sqrt(variance):
            scales[joint] = solved[0] / size[0]
    return scales


def torque_scale(equations: Equations) -> float:
    """The factor of all torques; 1 where it is within FAR."""
    known = np.abs(joint_scales(equations))
    known = known[np.isfinite(known)]
    factor = float(np.median(known)) if len(known) else 1.0
    return factor if not 1.0 / FAR <= factor <= FAR else 1.0
