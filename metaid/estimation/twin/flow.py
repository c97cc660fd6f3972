"""One step of a twin that is driven, and its derivative by every unknown, compiled.

A simulated plant steps as Euler does (Eq. 23). One that moves continuously is followed by the fourth-order Runge-Kutta
method: the torque is held for the step, as a motor holds it (Eq. 46). In each of the four stages φ̇ = ω and ω̇ = α, and
the derivatives move as Eq. 23 says. So they are exact for the discrete motion of both.
"""

from __future__ import annotations

from metaid.compiled import compiled, fused
from metaid.estimation.twin.beside import force_beside
from metaid.estimation.twin.joints import begin_slips, end_slips
from metaid.estimation.twin.kernels import accelerate, force_by_unknowns, linearise
from metaid.estimation.twin.state import move
from metaid.estimation.twin.tangent import accelerate_tangent, carry, move_tangent


@compiled
def flow(step, forces, balance, derivatives, spread, timestep, is_continuous, work):  # type: ignore[no-untyped-def]
    """Moves the twin and its derivatives on by a timestep; whether it could.

    Args:
        step: of the commanded torques, from 0.
        forces: that act at each step (nstep x njoint), in N m.
        balance, derivatives: of a kernel; the first without a law, None for the second where nothing is unknown.
        spread: of a filter, whose step is filled in; None for none.
        timestep: in s.
        is_continuous: whether by four stages, or by one step of Euler's.
        work: see `workspace`.
    """
    for i in range(work.force.shape[0]):
        work.force[i] = forces[step, i]
    if is_continuous:
        _begin(derivatives, work)
    for stage in range(4 if is_continuous else 1):
        if not accelerate(balance, work):
            return False
        if spread is not None:  # noqa: SIM102 - numba leaves out what is asked by itself
            if stage == 0:
                linearise(balance, work)
                carry(timestep, is_continuous, spread, work)
        if derivatives is not None:  # noqa: SIM102
            if work.moved.shape[1] > 0:
                linearise(balance, work)
                force_by_unknowns(balance, derivatives, work)
                force_beside(step, balance, derivatives.beside, is_continuous, work)
                accelerate_tangent(work)
        if not is_continuous:
            if derivatives is not None:
                move_tangent(timestep, work)
            return move(timestep, work)
        _add_stage(stage, timestep, derivatives, work)
    return _end(timestep, balance, derivatives, work)


@compiled
def _begin(derivatives, work):  # type: ignore[no-untyped-def]
    """Keeps the state before the step."""
    angle, speed, stages = work.angle, work.speed, work.stages
    for i in range(angle.shape[0]):
        stages[0, i], stages[1, i] = angle[i], speed[i]
        stages[2, i] = stages[3, i] = 0.0
    begin_slips(work)
    if derivatives is not None:  # of what is None nothing is compiled
        _hold(work)


@compiled
def _add_stage(stage, timestep, derivatives, work):  # type: ignore[no-untyped-def]
    """Adds what a stage, from 0, has of the step, and sets off for the next."""
    angle, speed, stages = work.angle, work.speed, work.stages
    weight = timestep / 6.0 if stage == 0 or stage == 3 else timestep / 3.0
    ahead = 0.0 if stage == 3 else timestep if stage == 2 else 0.5 * timestep
    for i in range(angle.shape[0]):
        rate, change = speed[i], work.acceleration[i]
        stages[2, i] += weight * rate
        stages[3, i] += weight * change
        angle[i], speed[i] = stages[0, i] + ahead * rate, stages[1, i] + ahead * change
    if derivatives is not None:
        _add_slopes(weight, ahead, work)


@compiled
def _end(timestep, balance, derivatives, work):  # type: ignore[no-untyped-def]
    """The state after the step; False beyond a radian a step, and for NaN."""
    angle, speed, stages = work.angle, work.speed, work.stages
    for i in range(angle.shape[0]):
        angle[i], speed[i] = stages[0, i] + stages[2, i], stages[1, i] + stages[3, i]  # Eq. 46
        if not abs(speed[i]) * timestep <= 1.0:
            return False
    if derivatives is None:
        end_slips(balance, None, work)
    else:
        _add_all(work)
        end_slips(balance, derivatives.beside, work)
    return True


@fused
def _hold(work):  # type: ignore[no-untyped-def]
    """Keeps the derivatives before the step."""
    for i in range(2 * work.angle.shape[0]):
        row, held, added = work.moved[i], work.held[i], work.added[i]
        for p in range(row.shape[0]):
            held[p], added[p] = row[p], 0.0


@fused
def _add_slopes(weight, ahead, work):  # type: ignore[no-untyped-def]
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
