"""The twin of a noisy arm: driven by the torques that were commanded, and seen as its sensors see it."""

from __future__ import annotations

import numpy as np

from metaid.compiled.arms import follow_torques
from metaid.estimation.arms.motions import STEP, THREADS, beside
from metaid.estimation.arms.unknowns import ArmUnknowns
from metaid.estimation.trials import Coefficients, Driven, Joints
from metaid.models import Array
from metaid.models.tree import PARAMETERS, tilted_gravity

DAMPING, COULOMB = PARAMETERS.index("damping"), PARAMETERS.index("coulomb")


def drive_arm(
    driven: Driven, searched: ArmUnknowns, unknowns: Array, gravity: float, joints: Joints | None = None
) -> Coefficients | None:
    """The twin of a trial, `driven` by what was commanded, and one beside it along each unknown; None where one of them
    cannot follow.

    Args:
        driven: the trial.
        searched: what is unknown of the arm.
        unknowns: where it is (nunknown).
        gravity: that of the arm counts.
        joints: what these have beside the base parameters; None for nothing.
    """
    trial, states, steps, basis = driven
    npush, _, n = states.shape
    # A start of one push has no influence on another, so those of all pushes are changed at once.
    extra = 0 if trial.start_spread is None else trial.start_spread.shape[-1]
    further = STEP * np.eye(extra, 2 * n, 2 * n - extra)
    points = np.concatenate([unknowns[None], beside(unknowns), np.repeat(unknowns[None], extra, axis=0)])
    moved = np.concatenate([np.zeros((1 + len(unknowns), 2 * n)), further]).reshape(-1, 1, 2, n)
    candidates, frames, spring, offset = searched.parameters(points), searched.frames, None, np.zeros(n)
    if joints is not None:
        candidates[..., DAMPING] += joints.viscous
        candidates[..., COULOMB] += joints.dry
        frames = frames._replace(gravity=tilted_gravity(frames.gravity, joints.tilt))
        spring, offset = joints.spring, joints.offset
    starts = np.ascontiguousarray(states + moved)
    starts[:, :, 0] -= offset
    seen = basis, np.arange(npush), steps
    twin = follow_torques(
        frames, candidates, starts, trial.torques, seen, trial.timestep, THREADS, spring, trial.substeps
    )
    if not twin.arrived[:, steps > 0].all():
        return None
    read = np.where(steps[:, None] > 0, basis.sum(axis=1), 0.0)[:, None] * offset[:, None]
    values = twin.values.swapaxes(2, 3)
    slopes = np.moveaxis((values[1:] - values[0]) / STEP, 0, -1)
    return Coefficients(np.where((steps > 0)[:, None, None], values[0] + read, 0.0), np.ascontiguousarray(slopes))
