"""The twin of a noisy arm: driven by the torques that were commanded, and seen as its sensors see it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.compiled.spatial import Followed, Frames, Times, follow_torques
from metaid.estimation.spatial.motions import STEP, THREADS, beside
from metaid.estimation.spatial.unknowns import ArmUnknowns
from metaid.estimation.trials import Coefficients, Driven, Joints
from metaid.models import Array
from metaid.models.tree import PARAMETERS, tilted_gravity

DAMPING, COULOMB = PARAMETERS.index("damping"), PARAMETERS.index("coulomb")


@dataclass(frozen=True)
class Beside:
    """A twin, and one beside it along each unknown.

    Attributes:
        frames: of the arm, as it stands.
        candidates: parameters of the twins (ncandidate x njoint x 13).
        starts: true joint coordinates and speeds at the starts (ncandidate x npush x 2 x njoint).
        spring: stiffness of springs in the joints (njoint), in N m/rad or N/m.
        offset: what encoders read at 0 (njoint), in rad or m.
    """

    frames: Frames
    candidates: Array
    starts: Array
    spring: Array
    offset: Array


def twins_beside(driven: Driven, searched: ArmUnknowns, unknowns: Array, joints: Joints | None) -> Beside:
    """The twin of a trial and those beside it.

    Args:
        driven: the trial.
        searched: what is unknown of the arm.
        unknowns: where it is (nunknown).
        joints: what these have beside the base parameters; None for nothing.
    """
    trial, states = driven.trial, driven.starts
    n = states.shape[2]
    # A start of one push has no influence on another, so those of all pushes are changed at once.
    extra = 0 if trial.start_spread is None else trial.start_spread.shape[-1]
    further = STEP * np.eye(extra, 2 * n, 2 * n - extra)
    points = np.concatenate([unknowns[None], beside(unknowns), np.repeat(unknowns[None], extra, axis=0)])
    moved = np.concatenate([np.zeros((1 + len(unknowns), 2 * n)), further]).reshape(-1, 1, 2, n)
    candidates, frames, spring, offset = searched.parameters(points), searched.frames, np.zeros(n), np.zeros(n)
    if joints is not None:
        candidates[..., DAMPING] += joints.viscous
        candidates[..., COULOMB] += joints.dry
        frames = frames._replace(gravity=tilted_gravity(frames.gravity, joints.tilt))
        spring, offset = joints.spring, joints.offset
    starts = np.ascontiguousarray(states + moved)
    starts[:, :, 0] -= offset
    return Beside(frames, candidates, starts, spring, offset)


def coefficients_of(twin: Followed, steps: NDArray[np.int64]) -> Coefficients:
    """What twins showed of pushes that are followed for so many `steps` (npush), and its derivatives by differences."""
    values = twin.values.swapaxes(2, 3)
    slopes = np.moveaxis((values[1:] - values[0]) / STEP, 0, -1)
    return Coefficients(np.where((steps > 0)[:, None, None], values[0], 0.0), np.ascontiguousarray(slopes))


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
    trial, _, steps, basis = driven
    twins = twins_beside(driven, searched, unknowns, joints)
    seen = basis, np.arange(len(steps)), steps
    settings = Times(trial.timesteps, trial.substeps, trial.is_continuous), THREADS, twins.spring
    twin = follow_torques(twins.frames, twins.candidates, twins.starts, trial.torques, seen, *settings)
    if not twin.arrived[:, steps > 0].all():
        return None
    shown = coefficients_of(twin, steps)
    read = np.where(steps[:, None] > 0, basis.sum(axis=1), 0.0)[:, None] * twins.offset[:, None]
    return shown._replace(values=shown.values + read)
