"""What changes of the motion of an arm with its state and with each unknown, compiled.

By the state these are differences of the balance of forces F − M q̈, with q̈ held (Eq. 23); by parameters, which it is
linear in, exact (Eqs. 49 to 52).
"""

from __future__ import annotations

from metaid.compiled import compiled, fused, solve_rows
from metaid.compiled.spatial import (
    Frames,
    accelerating_torques,
    cross,
    dot,
    joint_torques,
    move_links,
    outward,
    place_link,
    plus,
    put,
    symmetric,
    triple,
)
from metaid.estimation.twin.joints import slopes_of_joints
from metaid.estimation.twin.spatial_motion import DAMPING, ROTOR, STOPPING

STEP = 1e-6  # rad or rad/s: a longer one meets the curvature, a shorter one rounding


@fused
def linearise(balance, work):  # type: ignore[no-untyped-def]
    """Fills `solved` (njoint x 3 njoint) with M⁻¹ [1 G H]. Links are where `accelerate` has placed them."""
    own, solved = work.own, work.solved
    n = own.force.shape[0]
    solved[:] = 0.0
    for i in range(n):
        solved[i, i] = 1.0
    _add_slopes_of_torques(-1.0, balance.parameters, work.acceleration, 0.0, balance, work)
    if balance.law.shape[0] > 0:
        _add_slopes_of_torques(1.0, balance.law, own.pull, balance.stiffness, balance, work)
    slopes_of_joints(balance, work)
    for i in range(n if balance.softness.shape[0] > 0 else 0):
        if balance.sticking[i] > 0.0 and work.slip[2, i] == 0.0:
            solved[i, 2 * n + i] -= STOPPING / balance.softness[i]
    solve_rows(own.space.factor, solved)


@fused
def _add_slopes_of_torques(sign, parameters, acceleration, stiffness, balance, work):  # type: ignore[no-untyped-def]
    """Adds to G and H of `solved` what the torques that accelerate an arm change by with the state, without what joints
    have. From the last joint on, for a joint moves no link before its own.

    Args:
        sign: which they have in the balance of forces.
        parameters: of the arm (njoint x 13), without friction.
        acceleration: of the joints (njoint), in rad/s² or m/s².
        stiffness: by which that falls with the angles, in 1/s².
        balance, work: of the kernel.
    """
    frames, own, speed, n = balance.frames, work.own, work.speed, work.speed.shape[0]
    move_links(frames, parameters, 0, speed, acceleration, own.space)
    joint_torques(frames, parameters, acceleration, own.space, own.left)
    for i in range(n - 1, -1, -1):
        for by_speed in range(2):
            before, pull = speed[i], acceleration[i]
            if by_speed == 1:
                speed[i] += STEP
            else:
                place_link(frames, i, own.position[i] + STEP, own.space)
                acceleration[i] -= stiffness * STEP
            move_links(frames, parameters, i, speed, acceleration, own.space)
            joint_torques(frames, parameters, acceleration, own.space, own.other)
            speed[i], acceleration[i] = before, pull
            place_link(frames, i, own.position[i], own.space)
            for r in range(n):
                work.solved[r, (1 + by_speed) * n + i] += sign * (own.other[r] - own.left[r]) * (1.0 / STEP)


@fused
def force_by_unknowns(balance, derivatives, work):  # type: ignore[no-untyped-def]
    """Fills `changed` (njoint x nunknown) with M⁻¹ Y."""
    own, changed, links, kinds = work.own, work.changed, derivatives.links, derivatives.kinds
    move_links(balance.frames, balance.parameters, 0, work.speed, work.acceleration, own.space)
    _carry_joints(balance.frames, own)
    changed[:] = 0.0
    for p in range(links.shape[0]):
        link, kind = links[p], kinds[p]
        if kind < ROTOR:
            _weigh_body(link, kind, own, changed, p)
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
    solve_rows(own.space.factor, changed)


@compiled
def _carry_joints(frames, own):  # type: ignore[no-untyped-def]
    """Fills in how each link turns, and its origin moves, as one joint before it moves alone."""
    n, none = frames.axis.shape[0], (0.0, 0.0, 0.0)
    for i in range(n):
        axis = triple(frames.axis[i])
        spin, speed = (axis, none) if frames.is_slide[i] == 0.0 else (none, axis)
        put(own.turning[i, i], spin)
        put(own.moving[i, i], speed)
        for link in range(i + 1, n):
            matrix, place = own.space.matrix[link], triple(own.space.place[link])
            speed = outward(matrix, plus(speed, cross(spin, place)))
            spin = outward(matrix, spin)
            put(own.turning[i, link], spin)
            put(own.moving[i, link], speed)


@compiled
def _weigh_body(link, kind, own, changed, column):  # type: ignore[no-untyped-def]
    """Takes what a unit of one parameter of a body needs as it moves from a column of `changed`: of each joint before
    it the power, where that moves alone.  Eqs. 50 and 51.
    """
    space = own.space
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
    for i in range(link + 1):
        changed[i, column] -= dot(triple(own.turning[i, link]), moment) + dot(triple(own.moving[i, link]), force)


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
