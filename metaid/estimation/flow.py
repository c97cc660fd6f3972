"""One step of the twin of a plant that moves continuously, by the fourth-order Runge-Kutta method, and its derivative
by every unknown, compiled.

The torque is held for the step, as a motor holds it (Eq. 46). In each of the four stages φ̇ = ω and ω̇ = α of Eq. 22,
and the derivatives move as Eq. 23 says. So they are exact for the discrete motion, as those of Euler's steps are.
"""

from __future__ import annotations

import numpy as np

from metaid.compiled import compiled, fused
from metaid.estimation.beside import force_beside, slip_beside
from metaid.estimation.motion import accelerate, slipping
from metaid.estimation.tangent import accelerate_tangent, builds_up, force_by_unknowns, linearise


@compiled
def flow(step, forces, balance, derivatives, timestep, work):  # type: ignore[no-untyped-def]
    """Moves the twin and its derivatives on by a timestep; whether it could.

    Args:
        step: of the commanded torques, from 0.
        forces: Q of Eq. 22 at each step (nstep x njoint), in N m.
        balance, derivatives, work: see `workspace`; `balance` without a law.
        timestep: in s.
    """
    angle, speed, stages = work.angle, work.speed, work.stages
    n = angle.shape[0]
    for i in range(n):
        stages[0, i], stages[1, i] = angle[i], speed[i]
        stages[2, i] = stages[3, i] = 0.0
    begin_slips(work)
    _hold(work)
    for stage in range(4):
        if not accelerate(step, forces, balance, work):
            return False
        if work.moved.shape[1] > 0:
            linearise(balance, work)
            force_by_unknowns(derivatives, work)
            _force_by_slips(balance, work)
            force_beside(step, balance, derivatives.beside, work)
            accelerate_tangent(work)
        weight = timestep / 6.0 if stage == 0 or stage == 3 else timestep / 3.0
        ahead = 0.0 if stage == 3 else timestep if stage == 2 else 0.5 * timestep
        for i in range(n):
            rate, change = speed[i], work.acceleration[i]
            stages[2, i] += weight * rate
            stages[3, i] += weight * change
            angle[i], speed[i] = stages[0, i] + ahead * rate, stages[1, i] + ahead * change
        _add_stage(weight, ahead, work)
    for i in range(n):
        angle[i], speed[i] = stages[0, i] + stages[2, i], stages[1, i] + stages[3, i]  # Eq. 46
        if not abs(speed[i]) * timestep <= 1.0:
            return False
    _add_all(work)
    _end_slips(balance, derivatives.beside, work)
    return True


@fused
def begin_slips(work):  # type: ignore[no-untyped-def]
    """Keeps where joints are, from which dry friction builds up."""
    for i in range(work.angle.shape[0]):
        work.slip[1, i] = work.angle[i] - (work.angle[i - 1] if i > 0 else 0.0)


@fused
def _force_by_slips(balance, work):  # type: ignore[no-untyped-def]
    """Adds to `changed` what dry friction depends on from before the step: where the joint was, and its share then."""
    n = work.angle.shape[0]
    for i in range(n):
        if balance.dry[i] == 0.0:
            continue
        by_share, by_angle = _slip_slopes(i, balance, work)
        slipped, own = work.slipped[i], work.held[i]
        for r in range(n):
            lever = work.solved[r, i] - (work.solved[r, i - 1] if i > 0 else 0.0)
            weight, other, row = -balance.dry[i] * lever, -balance.dry[i] * lever * by_angle, work.changed[r]
            for p in range(row.shape[0]):
                row[p] += weight * by_share * slipped[p] - other * own[p]
            if i > 0:
                below = work.held[i - 1]
                for p in range(row.shape[0]):
                    row[p] += other * below[p]


@fused
def _slip_slopes(joint, balance, work):  # type: ignore[no-untyped-def]
    """Derivatives of the share of dry friction by that before the step, and by the angle now, in 1/rad."""
    below, turning = (work.angle[joint - 1], work.speed[joint - 1]) if joint > 0 else (0.0, 0.0)
    moved = work.angle[joint] - below - work.slip[1, joint]
    return np.exp(-abs(moved) / balance.presliding), builds_up(joint, work.speed[joint] - turning, balance, work)


@fused
def _end_slips(balance, beside, work):  # type: ignore[no-untyped-def]
    """The share of dry friction after the step, and its derivatives."""
    for i in range(work.angle.shape[0] if balance.presliding > 0.0 else 0):
        below, turning = (work.angle[i - 1], work.speed[i - 1]) if i > 0 else (0.0, 0.0)
        slipping(i, work.angle[i] - below, work.speed[i] - turning, balance, work)
        by_share, by_angle = _slip_slopes(i, balance, work)
        slipped, own, held = work.slipped[i], work.moved[i], work.held[i]
        for p in range(slipped.shape[0]):
            slipped[p] = by_share * slipped[p] + by_angle * (own[p] - held[p])
        if i > 0:
            own_below, held_below = work.moved[i - 1], work.held[i - 1]
            for p in range(slipped.shape[0]):
                slipped[p] -= by_angle * (own_below[p] - held_below[p])
        if beside.by_kind.shape[2] > 0:
            slip_beside(i, balance, beside, work)
        work.slip[0, i] = work.slip[2, i]


@fused
def _hold(work):  # type: ignore[no-untyped-def]
    """Keeps the derivatives before the step."""
    for i in range(2 * work.angle.shape[0]):
        row, held, added = work.moved[i], work.held[i], work.added[i]
        for p in range(row.shape[0]):
            held[p], added[p] = row[p], 0.0


@fused
def _add_stage(weight, ahead, work):  # type: ignore[no-untyped-def]
    """Adds what a stage has of the step to the derivatives, and sets off for the next, so far `ahead` of the step."""
    n = work.angle.shape[0]
    for i in range(n):
        angle_row, speed_row, change = work.moved[i], work.moved[n + i], work.changed[i]
        held_angle, held_speed = work.held[i], work.held[n + i]
        added_angle, added_speed = work.added[i], work.added[n + i]
        for p in range(change.shape[0]):
            added_angle[p] += weight * speed_row[p]
            added_speed[p] += weight * change[p]
            angle_row[p] = held_angle[p] + ahead * speed_row[p]
            speed_row[p] = held_speed[p] + ahead * change[p]


@fused
def _add_all(work):  # type: ignore[no-untyped-def]
    """The derivatives after the step."""
    for i in range(2 * work.angle.shape[0]):
        row, held, added = work.moved[i], work.held[i], work.added[i]
        for p in range(row.shape[0]):
            row[p] = held[p] + added[p]
