"""What the compiled loops of a twin work in, and what is unknown beside the robot.

A twin moves in coordinates of its kernel: a planar one in absolute angles of links, a spatial one in those of joints.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import BLOCK, LANES, whole
from metaid.estimation.trials import PRESLIDING, Joints
from metaid.models import Array

# What joints have that is unknown, in this order: of dry friction also the way over which it builds up.
KINDS = ("viscous", "dry", "spring", "cosine", "sine", "rotor", "straight", "lean", "presliding")


class Beside(NamedTuple):
    """What each unknown beside the robot has, for n joints: `torques` (nstep x n x ntorque) of a push, in N m, those of
    the first of them; `by_kind` (n x KINDS x nother) and `lean` (n x nother) those of the others: how much of each kind
    a joint has, and how far a coordinate is from where it is read; and `tilts` (naxis x nother) of a base that turns
    about axes of its own. The first has the column `first`.
    """

    torques: Array
    by_kind: Array
    lean: Array
    tilts: Array
    first: int


class Workspace(NamedTuple):
    """What one thread works in, for n joints and p unknowns; rows and columns beyond are zero.

    The state, in the kernel's coordinates: `angle`, `speed`, `acceleration`, and the angle at the `start` (n); `force`
    (n), in N m or N, that acts beside the law. `solved` (n x 3 n): M⁻¹ [1 G H]. `closed` (n x 2 n): the last two of
    these. `moved` (2 n x p): δφ above δω. `changed` (n x p): δα. `stages` (4 x n): of a Runge-Kutta step the state
    before it, angles and speeds, and what it adds to them; `held` and `added` (2 n x p): the same of the derivatives.
    `slip` (4 x n): of dry friction its share of all of it before the step, where the joint was then, in rad, the share
    now, and its derivative by that before; `slipped` (n x p): derivatives of the first. `teeth` (2 x n): cosine and
    sine of the phase of cogging. `units` (KINDS): of one joint, see `beside`. `twist` (n x p): the derivatives of the
    torques in joints, and `levers` (n x n) what each link accelerates by with one. `free` (n) is free to write in.
    `below` (n): the link whose angle a joint's own is beside, -1 for none. `own` is the kernel's.
    """

    angle: Array
    speed: Array
    acceleration: Array
    start: Array
    force: Array
    solved: Array
    closed: Array
    moved: Array
    changed: Array
    stages: Array
    held: Array
    added: Array
    slip: Array
    teeth: Array
    slipped: Array
    units: Array
    twist: Array
    levers: Array
    free: Array
    below: NDArray[np.int64]
    own: Any


def workspace(below: NDArray[np.int64], own: Any, nunknown: int, is_continuous: bool = False) -> Workspace:
    """Working space for a twin.

    Args:
        below: the link whose angle a joint's own is beside (njoint), -1 for none.
        own: the kernel's.
        nunknown: the number of unknowns.
        is_continuous: whether it takes Runge-Kutta steps.
    """
    n = len(below)
    rows, inner, columns = whole(n, BLOCK), whole(2 * n, BLOCK), whole(nunknown, LANES)
    of_stages = inner, columns * is_continuous
    angle, speed, acceleration, start, force, free = np.zeros((6, n))
    return Workspace(
        angle,
        speed,
        acceleration,
        start,
        force,
        solved=np.zeros((n, 3 * n)),
        closed=np.zeros((rows, inner)),
        moved=np.zeros((inner, columns)),
        changed=np.zeros((rows, columns)),
        stages=np.zeros((4, n)),
        held=np.zeros(of_stages),
        added=np.zeros(of_stages),
        slip=np.zeros((4, n)),
        teeth=np.array([np.ones(n), np.zeros(n)]),
        slipped=np.zeros((n, columns * is_continuous)),
        units=np.zeros(len(KINDS)),
        twist=np.zeros((rows, columns)),
        levers=np.zeros((rows, rows)),
        free=free,
        below=below,
        own=own,
    )


def beside(torques: Array, joints: Joints, leaning: tuple[Array, Array, Array], first: int) -> Beside:
    """What is unknown beside the robot.

    Args:
        torques: of those that have some (nstep x njoint x ntorque), in N m.
        joints: what they have for one of each of the others (nother x ... each).
        leaning: what that makes of the kernel's coordinates, see `Twin`.
        first: the column of the first of them.
    """
    lean, from_below, tilts = leaning
    presliding = np.repeat(joints.presliding, lean.shape[1], axis=1)
    kinds = joints.viscous, joints.dry, joints.spring, *joints.cogging.swapaxes(0, 1)[:2], joints.rotor, joints.offset
    by_kind = np.ascontiguousarray(np.array([*kinds, from_below, presliding]).transpose(2, 0, 1))
    return Beside(torques, by_kind, np.ascontiguousarray(lean.T), np.ascontiguousarray(tilts), first)


def no_joints(njoint: int, tilts: int) -> Joints:
    """So many joints that have nothing beside the parameters, with a base that may be tilted about so many axes."""
    none = np.zeros(njoint)
    return Joints(none, none, none, none, np.zeros(tilts), none, np.array([PRESLIDING]), np.zeros((3, njoint)))
