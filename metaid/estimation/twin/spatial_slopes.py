"""What changes of the motion of an arm with its state and with each unknown, compiled.

By the state these are differences of the balance of forces F − M q̈, with q̈ held (Eq. 23); by parameters, which it is
linear in, exact (Eqs. 49 to 52).
"""

from __future__ import annotations

from metaid.compiled import compiled, fused
from metaid.compiled.spatial import (
    Frames,
    accelerating_torques,
    cross,
    dot,
    inward,
    move_links,
    plus,
    symmetric,
    triple,
)
from metaid.estimation.twin.joints import slopes_of_joints
from metaid.estimation.twin.spatial_motion import DAMPING, ROTOR, STOPPING, place

STEP = 1e-6  # rad or rad/s: a longer one meets the curvature, a shorter one rounding


@fused
def linearise(balance, work):  # type: ignore[no-untyped-def]
    """Fills `solved` (njoint x 3 njoint) with M⁻¹ [1 G H]."""
    own, solved = work.own, work.solved
    n = own.force.shape[0]
    _unbalanced(balance, work, own.left)
    for i in range(n):
        angle, speed = work.angle[i], work.speed[i]
        work.angle[i] = angle + STEP
        _unbalanced(balance, work, own.other)
        work.angle[i] = angle
        for r in range(n):
            solved[r, n + i] = (own.other[r] - own.left[r]) * (1.0 / STEP)
        work.speed[i] = speed + STEP
        _unbalanced(balance, work, own.other)
        work.speed[i] = speed
        for r in range(n):
            solved[r, 2 * n + i] = (own.other[r] - own.left[r]) * (1.0 / STEP)
            solved[r, i] = 1.0 if r == i else 0.0
    slopes_of_joints(balance, work)
    for i in range(n if balance.softness.shape[0] > 0 else 0):
        if balance.sticking[i] > 0.0 and work.slip[2, i] == 0.0:
            solved[i, 2 * n + i] -= STOPPING / balance.softness[i]
    _solve_rows(own.space.factor, solved)


@compiled
def _unbalanced(balance, work, torque):  # type: ignore[no-untyped-def]
    """Fills in the `torque` (njoint) that is left of F − M q̈, without what joints have."""
    own = work.own
    place(balance, work)
    speed, space = work.speed, own.space
    accelerating_torques(balance.frames, balance.parameters, own.position, speed, work.acceleration, space, torque)
    for i in range(torque.shape[0]):
        torque[i] = -torque[i]
    if balance.law.shape[0] > 0:
        accelerating_torques(balance.frames, balance.law, own.position, speed, own.pull, space, own.force)
        for i in range(torque.shape[0]):
            torque[i] += own.force[i]


@fused
def _solve_rows(factor, rows):  # type: ignore[no-untyped-def]
    """Replaces `rows` (njoint x any) by the solution of factor · factorᵀ x = rows."""
    n = factor.shape[0]
    for i in range(n):
        row, scale = rows[i], 1.0 / factor[i, i]
        for j in range(i):
            share, other = factor[i, j], rows[j]
            for p in range(row.shape[0]):
                row[p] -= share * other[p]
        for p in range(row.shape[0]):
            row[p] *= scale
    for i in range(n - 1, -1, -1):
        row, scale = rows[i], 1.0 / factor[i, i]
        for j in range(i + 1, n):
            share, other = factor[j, i], rows[j]
            for p in range(row.shape[0]):
                row[p] -= share * other[p]
        for p in range(row.shape[0]):
            row[p] *= scale


@fused
def force_by_unknowns(balance, derivatives, work):  # type: ignore[no-untyped-def]
    """Fills `changed` (njoint x nunknown) with M⁻¹ Y."""
    own, changed, links, kinds = work.own, work.changed, derivatives.links, derivatives.kinds
    place(balance, work)
    move_links(balance.frames, own.position, work.speed, work.acceleration, own.space)
    changed[:] = 0.0
    for p in range(links.shape[0]):
        link, kind = links[p], kinds[p]
        if kind < ROTOR:
            _weigh_body(balance.frames, link, kind, own.space, changed, p)
        elif kind == ROTOR:
            changed[link, p] = -work.acceleration[link]
        elif kind == DAMPING:
            changed[link, p] = -work.speed[link]
        else:
            changed[link, p] = -work.slip[2, link]
    for i in range(derivatives.softness.shape[0]):
        if balance.sticking[i] > 0.0 and work.slip[2, i] == 0.0:
            held = (work.acceleration[i] + STOPPING * work.speed[i]) / balance.softness[i] ** 2
            for p in range(links.shape[0]):
                changed[i, p] += held * derivatives.softness[i, p]
    _solve_rows(own.space.factor, changed)


@compiled
def _weigh_body(frames, link, kind, space, changed, column):  # type: ignore[no-untyped-def]
    """Takes what a unit of one parameter of a body needs as it moves from a column of `changed`.  Eqs. 50 and 51."""
    spin, spin_rate, rate = triple(space.spin[link]), triple(space.spin_rate[link]), triple(space.rate[link])
    force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if kind == 0:
        force = rate
    elif kind < 4:
        first = (1.0 if kind == 1 else 0.0, 1.0 if kind == 2 else 0.0, 1.0 if kind == 3 else 0.0)
        force = plus(cross(spin_rate, first), cross(spin, cross(spin, first)))
        moment = cross(first, rate)
    else:
        upper = (1.0 if kind == 4 else 0.0, 1.0 if kind == 5 else 0.0, 1.0 if kind == 6 else 0.0)
        lower = (1.0 if kind == 7 else 0.0, 1.0 if kind == 8 else 0.0, 1.0 if kind == 9 else 0.0)
        moment = plus(symmetric((upper, lower), spin_rate), cross(spin, symmetric((upper, lower), spin)))
    for i in range(link, -1, -1):
        axis = triple(frames.axis[i])
        changed[i, column] -= dot(axis, moment) if frames.is_slide[i] == 0.0 else dot(axis, force)
        force, moment = inward(space.matrix[i], force), inward(space.matrix[i], moment)
        moment = plus(moment, cross(triple(space.place[i]), force))


@fused
def turn_base(balance, beside, work):  # type: ignore[no-untyped-def]
    """Adds to `twist` what it does to turn the base, by which gravity turns there."""
    own, frames = work.own, balance.frames
    n, count = own.force.shape[0], beside.tilts.shape[1]
    first = beside.first + beside.torques.shape[2]
    for axis in range(beside.tilts.shape[0]):
        leaning = Frames(
            frames.fixed,
            frames.turned,
            frames.across,
            frames.position,
            frames.slide,
            frames.axis,
            frames.is_slide,
            balance.turned[axis],
        )
        still = own.zero
        accelerating_torques(leaning, balance.parameters, own.position, still, still, own.space, own.force)
        for i in range(n):
            row, force, tilts = work.twist[i, first : first + count], own.force[i], beside.tilts[axis]
            for p in range(row.shape[0]):
                row[p] -= force * tilts[p]
