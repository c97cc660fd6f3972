"""The motion of an arm, compiled, and what it follows from.

In joint coordinates q, M q̈ = F: the law's torque, that of the arm's own bias taken off, what joints have, and what was
commanded (Eq. 58). Dry friction is as MuJoCo has it where the plant takes steps of Euler's, and Dahl's where it moves
continuously. MuJoCo holds a joint by a constraint that is a little soft: f = −clip(D (q̈ + B q̇), −c, c). B and D follow
from its usual `solref` and `solimp`, D from the mass matrix at q = 0 too. Each joint therefore slides one way, slides
the other way, or sticks. Which of them do what is found step by step (Eq. 59).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import compiled, factorise, solve
from metaid.compiled.spatial import Frames, Space, accelerating_torques, fill_mass_matrix, new_space
from metaid.estimation.trials import Further, Joints
from metaid.estimation.twin.joints import joint_force
from metaid.estimation.twin.workspace import Beside, beside, no_joints
from metaid.models import Array
from metaid.models.tree import PARAMETERS, tilted_gravity

ROTOR, DAMPING, COULOMB = (PARAMETERS.index(kind) for kind in ("rotor", "damping", "coulomb"))  # the last three
STOPPING = 2.0 / (0.95 * 0.02)  # B in 1/s: MuJoCo's usual solref has 0.02 s, its solimp at most 0.95
ALL_AT_ONCE = 6  # attempts; then one joint at a time, which ends
MOST = 60
TILT = 1e-6  # rad, a step of a difference


class SpatialBalance(NamedTuple):
    """What the motion of an arm of n joints follows from.

    `parameters` (n x 13) are its own and `law` (n x 13; empty without one) those of the law, which asks for
    q̈ = −`stiffness` (q − q_start), both without friction; the `difference` (n x 13) is what the law's are beyond. Of
    friction `damping` (n), in N m s, is the law's less the arm's, and `coulomb` (n), in N m, the law's. That of the arm
    is `sticking` (n), a constraint of the `softness` (n; empty where no joint has any), or `dry` (n), which builds up
    over `presliding` rad. `turned` (2 x 3) is what gravity in the base changes by with its tilt. `spring` (n) is minus
    a stiffness, in N m/rad; `straight` (n) what a joint reads at 0; `cogging` (3 x n) that of `Joints`.
    """

    frames: Frames
    parameters: Array
    difference: Array
    law: Array
    stiffness: float
    sticking: Array
    softness: Array
    turned: Array
    damping: Array
    coulomb: Array
    spring: Array
    straight: Array
    dry: Array
    presliding: float
    cogging: Array


class SpatialDerivatives(NamedTuple):
    """By which parameters (nunknown) the motion is differentiated, the `links` and the `kinds` of them; the derivatives
    of the softness of friction by them (n x nunknown; empty where there is none); and what is unknown `beside` them.
    """

    links: NDArray[np.int64]
    kinds: NDArray[np.int64]
    softness: Array
    beside: Beside


class SpatialSpace(NamedTuple):
    """What a spatial kernel works in: of the dynamics; how each link turns, and its origin moves, as each joint moves
    alone (n x n x 3, by joint and link); and for n joints true coordinates, accelerations that the law asks for,
    forces, what holds joints, zeros, and the torques of two states.
    """

    space: Space
    turning: Array
    moving: Array
    position: Array
    pull: Array
    force: Array
    held: Array
    zero: Array
    left: Array
    other: Array


def spatial_balance(
    frames: Frames,
    parameters: Array,
    law: Array | None = None,
    softness: Array | None = None,
    joints: Joints | None = None,
    is_continuous: bool = False,
) -> SpatialBalance:
    """What the motion of an arm under a law follows from.

    Args:
        frames: where its joints are.
        parameters: of them and of its links (njoint x 13).
        law: parameters of the law (njoint x 13); without one only the arm's own forces act.
        softness: of dry friction (njoint), 1/D; None where it is no constraint.
        joints: what they have beside the parameters; None for nothing.
        is_continuous: whether the twin takes Runge-Kutta steps.
    """
    n = len(parameters)
    joints = no_joints(n, 2) if joints is None else joints
    own, sent = parameters.copy(), np.zeros_like(parameters) if law is None else np.array(law, order="C")
    damping = sent[:, DAMPING] - own[:, DAMPING] - joints.viscous
    coulomb, rubs = sent[:, COULOMB].copy(), own[:, COULOMB] + joints.dry
    own[:, ROTOR] += joints.rotor
    own[:, DAMPING:] = sent[:, DAMPING:] = 0.0
    tilts = np.array([[TILT, 0.0], [0.0, TILT]])
    leaning = [tilted_gravity(frames.gravity, joints.tilt + sign * tilt) for tilt in tilts for sign in (1.0, -1.0)]
    gravity = tilted_gravity(frames.gravity, joints.tilt) if joints.tilt.any() else frames.gravity
    return SpatialBalance(
        frames=frames._replace(gravity=gravity),
        parameters=own,
        difference=sent - own,
        law=sent[:0] if law is None else sent,
        stiffness=0.0,
        sticking=np.zeros(n) if is_continuous else rubs,
        softness=np.empty(0) if softness is None else softness,
        turned=(np.array(leaning[::2]) - np.array(leaning[1::2])) / (2.0 * TILT),
        damping=damping,
        coulomb=coulomb,
        spring=0.0 - joints.spring,
        straight=np.array(joints.offset),
        dry=rubs if is_continuous else np.zeros(n),
        presliding=float(joints.presliding[0]) if is_continuous else 0.0,
        cogging=np.array(joints.cogging),
    )


def spatial_derivatives(
    columns: NDArray[np.intp], softness: Array, further: Further, njoint: int
) -> SpatialDerivatives:
    """Those by parameters, and by what is `further` unknown, whose torques are those of the first push.

    Args:
        columns: of the parameters among all of them (nunknown).
        softness: its derivatives by them (njoint x nunknown; empty where there is no such friction).
        further: what is unknown beside them.
        njoint: the number of joints.
    """
    joints = no_joints(njoint, 2) if further.joints is None else further.joints
    lean = np.atleast_2d(0.0 - joints.offset)  # what reads too much is less far.  Eq. 43
    links, kinds = np.divmod(np.asarray(columns, dtype=np.int64), len(PARAMETERS))
    own = beside(further, lean, lean, np.atleast_2d(joints.tilt).T, len(columns))
    return SpatialDerivatives(links, kinds, softness, own)


def spatial_space(njoint: int) -> tuple[NDArray[np.int64], SpatialSpace]:
    """What every joint is beside (njoint), nothing, and what the kernel works in."""
    carried = np.zeros((2, njoint, njoint, 3))
    return np.full(njoint, -1), SpatialSpace(new_space(njoint), *carried, *np.zeros((7, njoint)))


@compiled
def accelerate(balance, work):  # type: ignore[no-untyped-def]
    """Fills in q̈ and the factor of M; whether M is positive definite."""
    own = work.own
    _place(balance, work)
    # The torque that the law leaves, dry friction of the arm apart, is that of the difference.  Eq. 58
    accelerating_torques(balance.frames, balance.difference, own.position, work.speed, own.pull, own.space, own.force)
    for i in range(own.force.shape[0]):
        own.force[i] += joint_force(i, balance, work) + work.force[i]
    fill_mass_matrix(balance.frames, balance.parameters, own.space)
    if not (_solve_with_friction(balance, work) if balance.softness.shape[0] > 0 else _solve_freely(work)):
        return False
    for i in range(own.force.shape[0]):
        work.acceleration[i] += own.pull[i]
    return True


@compiled
def _place(balance, work):  # type: ignore[no-untyped-def]
    """Fills in true coordinates, and the accelerations that the law asks for."""
    for i in range(work.angle.shape[0]):
        work.own.position[i] = work.angle[i] - balance.straight[i]
        work.own.pull[i] = -balance.stiffness * (work.angle[i] - work.start[i])


@compiled
def _solve_freely(work):  # type: ignore[no-untyped-def]
    """Fills in what the force makes of an arm without such friction; whether its mass matrix is one."""
    own = work.own
    if not factorise(own.space.mass_matrix, own.zero, own.space.factor):
        return False
    for i in range(own.force.shape[0]):
        work.acceleration[i] = own.force[i]
    solve(own.space.factor, work.acceleration)
    return True


@compiled
def _solve_with_friction(balance, work):  # type: ignore[no-untyped-def]
    """The same with dry friction, of which it keeps the share in each joint, 0 where it sticks.  Eq. 59.

    Where joints that are taken to slide would not, or the other way round, they are taken to do what they would: from
    one side to the other by way of sticking, and after some attempts the last such joint alone, which cannot go on
    for ever.
    """
    own, side, beyond, softness = work.own, work.slip[0], work.acceleration, balance.softness
    n = own.force.shape[0]
    for i in range(n):
        if balance.sticking[i] < 0.0:
            side[i] = np.sign(work.speed[i])
    for attempt in range(MOST):
        for i in range(n):
            dry = balance.sticking[i]
            own.held[i] = 0.0
            beyond[i] = own.force[i] - side[i] * dry
            if side[i] == 0.0 and dry > 0.0:
                own.held[i] = 1.0 / softness[i]
                beyond[i] -= (own.pull[i] + STOPPING * work.speed[i]) / softness[i]
        if not factorise(own.space.mass_matrix, own.held, own.space.factor):
            return False
        solve(own.space.factor, beyond)
        settled = True
        for j in range(n):
            i = n - 1 - j
            dry = balance.sticking[i]
            if dry > 0.0 and (settled or attempt < ALL_AT_ONCE):
                drag = (beyond[i] + own.pull[i] + STOPPING * work.speed[i]) / softness[i]
                would = 0.0 if abs(drag) <= dry else np.sign(drag)
                if would * side[i] < 0.0:
                    would = 0.0
                if would != side[i]:
                    settled = False
                    side[i] = would
        if settled:
            break
    for i in range(n):
        work.slip[2, i] = side[i]
    return True
