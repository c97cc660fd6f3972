"""Accelerations of an arm with dry friction: as MuJoCo has it, or by Dahl's law, as machines do.

MuJoCo holds a joint by a constraint that is a little soft: f = −clip(D (q̈ + B q̇), −c, c). B and D follow from its
usual `solref` and `solimp`, D from the mass matrix at q = 0 too. Each joint therefore slides one way, slides the other
way, or sticks. Which of them do what is found step by step (Eq. 59).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from metaid.compiled.decorator import compiled
from metaid.compiled.law import dahl
from metaid.compiled.spatial.dynamics import factorise, fill_mass_matrix, move_links, solve
from metaid.models import Array

STOPPING = 2.0 / (0.95 * 0.02)  # B in 1/s: MuJoCo's usual solref has 0.02 s, its solimp at most 0.95
SOFTNESS = (1.0 - 0.9) / 0.9  # of the constraint in units of 1/M, with the least of the usual solimp, 0.9
ALL_AT_ONCE = 6  # attempts; then one joint at a time, which ends
MOST = 60


class Motion(NamedTuple):
    """State and working space of a twin (njoint each): coordinates, speeds, the acceleration that the law asks for and
    that which the arm has beyond it, the force that makes the latter; of dry friction the softness of its constraint
    1/D, the side that each joint slides to (0: it sticks); zeros; four rows (4 x njoint) for the stages of a step; and
    of dry friction that builds up (2 x njoint) its share of all of it, and the coordinate, where the step began.
    """

    position: Array
    speed: Array
    pull: Array
    beyond: Array
    force: Array
    softness: Array
    side: Array
    held: Array
    zero: Array
    stages: Array
    slip: Array


def new_motion(njoint: int) -> Motion:
    """Working space for an arm with so many joints."""
    parts: list[Array] = [*np.zeros((9, njoint)), np.zeros((4, njoint)), np.zeros((2, njoint))]
    return Motion(*parts)


@compiled
def soften(frames, parameters, motion, space):  # type: ignore[no-untyped-def]
    """Fills in the softness of dry friction; whether there is a mass matrix at q = 0.

    Args:
        frames: of the arm.
        parameters: of the twin (njoint x 13).
        motion: whose `softness` is filled in.
        space: of the dynamics.
    """
    zero, column = motion.zero, motion.beyond
    move_links(frames, zero, zero, zero, space)
    fill_mass_matrix(frames, parameters, space)
    if not factorise(space.mass_matrix, zero, space.factor):
        return False
    for i in range(zero.shape[0]):
        for j in range(zero.shape[0]):
            column[j] = 1.0 if i == j else 0.0
        solve(space.factor, column)
        motion.softness[i] = SOFTNESS * column[i]
    return True


@compiled
def accelerate_freely(motion, space):  # type: ignore[no-untyped-def]
    """Fills in what the force makes of an arm without dry friction; whether its mass matrix is one."""
    if not factorise(space.mass_matrix, motion.zero, space.factor):
        return False
    for i in range(motion.force.shape[0]):
        motion.beyond[i] = motion.force[i]
    solve(space.factor, motion.beyond)
    return True


@compiled
def accelerate_with_friction(parameters, motion, space):  # type: ignore[no-untyped-def]
    """The same with dry friction.  Eq. 59.

    Where joints that are taken to slide would not, or the other way round, they are taken to do what they would: from
    one side to the other by way of sticking, and after some attempts the last such joint alone, which cannot go on
    for ever.
    """
    n = motion.force.shape[0]
    beyond, side, softness = motion.beyond, motion.side, motion.softness
    for i in range(n):
        if parameters[i, 12] < 0.0:
            side[i] = np.sign(motion.speed[i])
    for attempt in range(MOST):
        for i in range(n):
            dry = parameters[i, 12]
            motion.held[i] = 0.0
            beyond[i] = motion.force[i] - side[i] * dry
            if side[i] == 0.0 and dry > 0.0:
                motion.held[i] = 1.0 / softness[i]
                beyond[i] -= (motion.pull[i] + STOPPING * motion.speed[i]) / softness[i]
        if not factorise(space.mass_matrix, motion.held, space.factor):
            return False
        solve(space.factor, beyond)
        settled = True
        for j in range(n):
            i = n - 1 - j
            dry = parameters[i, 12]
            if dry > 0.0 and (settled or attempt < ALL_AT_ONCE):
                drag = (beyond[i] + motion.pull[i] + STOPPING * motion.speed[i]) / softness[i]
                would = 0.0 if abs(drag) <= dry else np.sign(drag)
                if would * side[i] < 0.0:
                    would = 0.0
                if would != side[i]:
                    settled = False
                    side[i] = would
        if settled:
            break
    return True


@compiled
def slipped(joint, presliding, motion):  # type: ignore[no-untyped-def]
    """The share of its dry friction that a joint has, −1 to 1, by Dahl's law from where the step began (Eq. 67), if it
    builds up over `presliding`, in rad or m.
    """
    moved = motion.position[joint] - motion.slip[1, joint]
    return dahl(motion.slip[0, joint], moved, motion.speed[joint], presliding)


@compiled
def slip_back(parameters, presliding, motion):  # type: ignore[no-untyped-def]
    """Takes dry friction that builds up over `presliding` (njoint), in rad or m, from the force.

    Args:
        parameters: of the twin (njoint x 13).
        presliding: of each joint.
        motion: with the force, and where the step began.
    """
    for i in range(motion.force.shape[0]):
        motion.force[i] -= parameters[i, 12] * slipped(i, presliding[i], motion)
