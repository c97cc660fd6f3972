"""One step of the twin of a plant that moves continuously, by the fourth-order Runge-Kutta method, and its derivative
by every unknown, compiled.

The torque is held for the step, as a motor holds it (Eq. 30). In each of the four stages φ̇ = ω and ω̇ = α of Eq. 22,
and the derivatives move as Eq. 23 says. So they are exact for the discrete motion, as those of Euler's steps are.
"""

from __future__ import annotations

from metaid.compiled import compiled, fused
from metaid.estimation.motion import accelerate
from metaid.estimation.tangent import accelerate_tangent, force_by_unknowns, linearise


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
    _hold(work)
    for stage in range(4):
        if not accelerate(step, forces, balance, work):
            return False
        linearise(balance, work)
        force_by_unknowns(derivatives, work)
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
        angle[i], speed[i] = stages[0, i] + stages[2, i], stages[1, i] + stages[3, i]  # Eq. 30
        if not abs(speed[i]) * timestep <= 1.0:
            return False
    _add_all(work)
    return True


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
