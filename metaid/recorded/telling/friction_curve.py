"""Friction as a curve: what is known of it even where its terms are not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models import Array
from metaid.recorded.estimating import RecordedEstimate

SHARES = (0.1, 0.4, 1.0)  # of a joint's fastest speed


@dataclass(frozen=True)
class FrictionCurve:
    """The friction of a `joint` that slides: torques in N m (N) with their standard deviations at speeds in rad/s
    (m/s).
    """

    joint: str
    speed: Array
    torque: Array
    sd: Array


def friction_curves(found: RecordedEstimate) -> list[FrictionCurve]:
    """The friction of each joint at three speeds that the logs have; what grows with load, at its usual load."""
    model, n = found.model, found.model.njoint
    usual = _usual_load(found)
    curves = []
    for joint in range(n):
        speeds = found.fastest[joint] * np.array(SHARES)
        moving, sliding = np.zeros((len(speeds), n)), np.zeros((len(speeds), n + len(model.coupled)))
        moving[:, joint], sliding[:, joint] = speeds, 1.0
        for pair, joints in enumerate(model.coupled):
            if joint in joints:
                sliding[:, n + pair] = 1.0
        rigid = np.zeros_like(moving)
        rigid[:, joint] = usual[joint]
        columns = model.friction_columns(moving, np.zeros_like(moving), sliding, rigid)[:, joint]
        offset = np.zeros(columns.shape[1])
        if "offset" in model.friction:
            offset[model.column("offset", joint) - model.nbody] = 1.0
        columns = columns * (1.0 - offset)
        covariance = found.covariance[model.nbody :, model.nbody :]
        variance = np.einsum("ij,jk,ik->i", columns, covariance, columns)
        curves.append(
            FrictionCurve(
                model.joints[joint],
                speeds,
                columns @ found.values[model.nbody :],
                np.sqrt(np.maximum(variance, 0.0)),
            )
        )
    return curves


def _usual_load(found: RecordedEstimate) -> Array:
    """The mean size of the torque of the bodies in each joint (njoint), in N m or N."""
    bodies = found.values[: found.model.nbody]
    sizes = []
    for log, own in enumerate(found.logs):
        at_rows = found.chosen.yardstick.at_rows(found.model, log, found.zeros[log])
        sizes.append(np.abs(at_rows[own.judged] @ bodies))
    return np.asarray(np.concatenate(sizes).mean(axis=0), dtype=np.float64)
