"""Joints without a motor: an error of theirs is an acceleration.

What acts in them is nothing, whatever their bodies weigh, so a torque that is left would be least of bodies that weigh
nothing. It is divided by the inertia that the joint turns, which is linear in the unknowns. How heavy the bodies are is
left to the joints with motors.  Eq. 68.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from metaid.models import Array
from metaid.recorded.weak_form.linear_model import LinearModel
from metaid.recorded.weak_form.windows import LogWindows

LEAST = 0.5  # of its inertia, that a joint keeps in a step


def own_inertias(model: LinearModel, parts: Sequence[LogWindows]) -> Array:
    """The mean inertia that a joint without a motor turns, for a unit of each of the bodies' unknowns (njoint x nbody),
    at the middles of windows; 0 of a joint with one.
    """
    poses = np.concatenate([part.coordinates[:, part.coordinates.shape[1] // 2] for part in parts])
    rest = np.zeros_like(poses)
    still = model.bodies(poses, rest, rest)
    inertias = np.zeros((model.njoint, model.nbody))
    for joint in np.flatnonzero(model.passive):
        moved = model.bodies(poses, rest, rest + np.eye(model.njoint)[joint])
        inertias[joint] = (moved - still)[:, joint].mean(axis=0)
    return inertias


def as_accelerations(
    rows: Sequence[Array], torques: Sequence[Array], values: Array, inertias: Array
) -> tuple[list[Array], list[Array]]:
    """Rows and torques whose errors are, of joints without a motor, those of accelerations, times the present inertia:
    linear about some unknowns.

    Args:
        rows: of each log (nwindow x ntest x njoint x nparam or more).
        torques: of each log (nwindow x ntest x njoint), in N m or N.
        values: the unknowns (nparam).
        inertias: as `own_inertias` has them (njoint x nbody).
    """
    nparam, (njoint, nbody) = len(values), inertias.shape
    slopes, passive = np.zeros((njoint, nparam)), inertias.any(axis=1)
    slopes[passive, :nbody] = inertias[passive] / (inertias[passive] @ values[:nbody])[:, None]
    others, sent = [], []
    for own, logged in zip(rows, torques, strict=True):
        left = logged - own[..., :nparam] @ values
        other = own.copy()
        other[..., :nparam] += left[..., None] * slopes
        others.append(other)
        sent.append(logged + left * (slopes @ values))
    return others, sent


def share_of_step(before: Array, after: Array, inertias: Array) -> float:
    """How much of a step between unknowns (nparam each) leaves each joint without a motor LEAST of its inertia."""
    own = inertias[inertias.any(axis=1)]
    first, last = (own @ values[: own.shape[1]] for values in (before, after))
    return float(np.min((1.0 - LEAST) * first / np.maximum(first - last, (1.0 - LEAST) * first)))
