"""What joints do beside the dynamics of links, compiled: friction, springs, cogging, for every kernel alike.

A joint turns a link, and the one below the other way. With s the share of dry friction that has built up (Eq. 67), its
torque is f = d q̇ + c sgn(q̇) + k (q - q₀) + cogging - f_d s, with signs as `balance` has them.
"""

from __future__ import annotations

import numpy as np

from metaid.compiled import compiled, fused
from metaid.models import SLIDING


@compiled
def joint_state(joint, work):  # type: ignore[no-untyped-def]
    """Angle and speed of a joint, in rad and rad/s."""
    below = work.below[joint]
    if below < 0:
        return work.angle[joint], work.speed[joint]
    return work.angle[joint] - work.angle[below], work.speed[joint] - work.speed[below]


@compiled
def joint_slopes(joint, first, slopes, work):  # type: ignore[no-untyped-def]
    """Fills in derivatives of what a joint has.

    Args:
        joint: its number.
        first: of the rows of `moved`: 0 for its angle, njoint for its speed.
        slopes: by the unknowns (nunknown), filled in.
        work: see `workspace.Workspace`.
    """
    own, below = work.moved[first + joint], work.below[joint]
    for p in range(slopes.shape[0]):
        slopes[p] = own[p]
    if below >= 0:
        other = work.moved[first + below]
        for p in range(slopes.shape[0]):
            slopes[p] -= other[p]


@compiled
def joint_force(joint, balance, work):  # type: ignore[no-untyped-def]
    """The torque in a joint, in N m; keeps the share of dry friction, and what cogging's derivatives need."""
    angle, speed = joint_state(joint, work)
    bent, share = angle - balance.straight[joint], min(max(speed * (1.0 / SLIDING), -1.0), 1.0)
    force = balance.damping[joint] * speed + balance.coulomb[joint] * share + balance.spring[joint] * bent
    if balance.cogging[2, joint] != 0.0:
        phase = balance.cogging[2, joint] * bent
        cosine, sine = np.cos(phase), np.sin(phase)
        work.teeth[0, joint], work.teeth[1, joint] = cosine, sine
        force += balance.cogging[0, joint] * cosine + balance.cogging[1, joint] * sine  # Eq. 42
    if balance.presliding > 0.0:
        force -= _slipping(joint, angle, speed, balance, work)
    else:
        work.slip[2, joint] = share
    return force


@compiled
def _slipping(joint, angle, speed, balance, work):  # type: ignore[no-untyped-def]
    """Dry friction, in N m, in a joint, by Dahl's law from where the step began (Eq. 67); keeps its share. Where the
    joint has not moved since, the direction of its speed counts.
    """
    slip, moved = work.slip, angle - work.slip[1, joint]
    goal, left = np.sign(moved) if moved != 0.0 else np.sign(speed), np.exp(-abs(moved) / balance.presliding)
    slip[2, joint], slip[3, joint] = goal + (slip[0, joint] - goal) * left, left
    return balance.dry[joint] * slip[2, joint]


@fused
def slopes_of_joints(balance, work):  # type: ignore[no-untyped-def]
    """Adds to H of `solved` what friction in joint i does to link i, and the other way to the one below; to G what
    springs, cogging and dry friction that builds up do.
    """
    solved = work.solved
    n = work.speed.shape[0]
    for i in range(n):
        speed, slope, spring = joint_state(i, work)[1], balance.damping[i], balance.spring[i]
        slope += balance.coulomb[i] / SLIDING if abs(speed) < SLIDING else 0.0
        if balance.cogging[2, i] != 0.0:
            by_phase = balance.cogging[1, i] * work.teeth[0, i] - balance.cogging[0, i] * work.teeth[1, i]
            spring += balance.cogging[2, i] * by_phase
        if balance.dry[i] != 0.0:
            spring -= balance.dry[i] * builds_up(i, balance, work)
        solved[i, 2 * n + i] += slope
        solved[i, n + i] += spring
        below = work.below[i]
        if below >= 0:
            solved[i, 2 * n + below] -= slope
            solved[below, 2 * n + i] -= slope
            solved[below, 2 * n + below] += slope
            solved[i, n + below] -= spring
            solved[below, n + i] -= spring
            solved[below, n + below] += spring


@fused
def pull_levers(work):  # type: ignore[no-untyped-def]
    """Fills `levers` with the acceleration of each link by a torque of 1 N m in each joint."""
    n = work.below.shape[0]
    for i in range(n):
        below = work.below[i]
        for r in range(n):
            work.levers[r, i] = work.solved[r, i] - (work.solved[r, below] if below >= 0 else 0.0)


@fused
def builds_up(joint, balance, work):  # type: ignore[no-untyped-def]
    """The derivative of the share of dry friction in a joint by its angle, in 1/rad; `slip` is as the force was."""
    angle, speed = joint_state(joint, work)
    moved = angle - work.slip[1, joint]
    goal = np.sign(moved) if moved != 0.0 else np.sign(speed)
    return goal * (goal - work.slip[2, joint]) / balance.presliding


@fused
def begin_slips(work):  # type: ignore[no-untyped-def]
    """Keeps where joints are, from which dry friction builds up."""
    for i in range(work.angle.shape[0]):
        work.slip[1, i] = joint_state(i, work)[0]


@fused
def twist_by_slips(balance, work):  # type: ignore[no-untyped-def]
    """Adds to `twist` what dry friction depends on from before the step: where the joint was, and its share then."""
    for i in range(work.angle.shape[0]):
        if balance.dry[i] == 0.0:
            continue
        by_share, by_angle = work.slip[3, i], builds_up(i, balance, work)
        weight, other = -balance.dry[i] * by_share, -balance.dry[i] * by_angle
        row, slipped, own, below = work.twist[i], work.slipped[i], work.held[i], work.below[i]
        for p in range(row.shape[0]):
            row[p] += weight * slipped[p] - other * own[p]
        if below >= 0:
            held = work.held[below]
            for p in range(row.shape[0]):
                row[p] += other * held[p]


@fused
def end_slips(balance, beside, work):  # type: ignore[no-untyped-def]
    """The share of dry friction after the step, and its derivatives, unless what is `beside` is None."""
    for i in range(work.angle.shape[0] if balance.presliding > 0.0 else 0):
        angle, speed = joint_state(i, work)
        _slipping(i, angle, speed, balance, work)
        if beside is not None:
            _slopes_of_slips(i, balance, beside, work)
        work.slip[0, i] = work.slip[2, i]


@fused
def _slopes_of_slips(joint, balance, beside, work):  # type: ignore[no-untyped-def]
    """The derivatives of the share of dry friction in a joint after the step."""
    by_share, by_angle = work.slip[3, joint], builds_up(joint, balance, work)
    slipped, own, held, below = work.slipped[joint], work.moved[joint], work.held[joint], work.below[joint]
    for p in range(slipped.shape[0]):
        slipped[p] = by_share * slipped[p] + by_angle * (own[p] - held[p])
    if below >= 0:
        own_below, held_below = work.moved[below], work.held[below]
        for p in range(slipped.shape[0]):
            slipped[p] -= by_angle * (own_below[p] - held_below[p])
    if beside.by_kind.shape[2] > 0:
        _slip_beside(joint, balance, beside, work)


@fused
def _slip_beside(joint, balance, beside, work):  # type: ignore[no-untyped-def]
    """Adds to `slipped` what the share of dry friction has changed by, by the way over which it builds up."""
    change, count = by_presliding(joint, balance, work), beside.by_kind.shape[2]
    first = beside.first + beside.torques.shape[2]
    row, share = work.slipped[joint, first : first + count], beside.by_kind[joint, work.units.shape[0] - 1]
    for p in range(row.shape[0]):
        row[p] += change * share[p]


@fused
def by_presliding(joint, balance, work):  # type: ignore[no-untyped-def]
    """The derivative of the share of dry friction in a joint by the way over which it builds up, in 1/rad;
    `slip` is as the force was.
    """
    if balance.presliding == 0.0:
        return 0.0
    moved = joint_state(joint, work)[0] - work.slip[1, joint]
    return (work.slip[2, joint] - np.sign(moved)) * abs(moved) / balance.presliding**2
