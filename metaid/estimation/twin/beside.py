"""The derivative of one step of a twin by what is unknown beside the robot, compiled: further torques, and what joints
have.

In Eq. 23 each such unknown p has a torque in some joints as its Y_p. That of joint i, its `twist`, is Σ_k φ_ik K_ikp,
with φ_ik what the state makes of a unit of a kind k, and K_ikp how much of it the unknown has. Where links lean, G of
Eq. 23 says what that does, but for joints, which do not.
"""

from __future__ import annotations

from metaid.compiled import fused, multiply
from metaid.estimation.twin.joints import builds_up, by_presliding, joint_state, pull_levers, twist_by_slips
from metaid.estimation.twin.kernels import turn_base


@fused
def force_beside(step, balance, beside, slips, work):  # type: ignore[no-untyped-def]
    """Adds to `changed` what is unknown beside the robot.

    Args:
        step: that begins, from 0.
        balance: what the motion follows from, of a kernel.
        beside: what is unknown.
        slips: whether dry friction builds up, so that derivatives hang on those before the step, too.
        work: see `workspace`; `solved` as `linearise` has filled it.
    """
    n, ntorque, count = beside.by_kind.shape[0], beside.torques.shape[2], beside.by_kind.shape[2]
    slips = slips and _any(balance.dry)
    if ntorque == 0 and count == 0 and not slips:
        return
    work.twist[:] = 0.0
    if slips:
        twist_by_slips(balance, work)
    first = beside.first + ntorque
    for i in range(n):
        row = work.twist[i, beside.first : first]
        for column in range(ntorque):
            row[column] += beside.torques[step, i, column]
    for i in range(n if count > 0 else 0):
        _of_units(i, balance, work)
        row, lean = work.twist[i, first : first + count], beside.lean[i]
        for k in range(work.units.shape[0]):
            unit, share = work.units[k], beside.by_kind[i, k]
            for p in range(row.shape[0]):
                row[p] += unit * share[p]
        for r in range(n):
            turned, changed = work.solved[r, n + i], work.changed[r, first : first + count]
            for p in range(row.shape[0]):
                changed[p] += turned * lean[p]
    if count > 0:
        turn_base(balance, beside, work)
    pull_levers(work)
    multiply(work.levers, work.twist, work.changed, 0, work.changed.shape[1])


@fused
def _any(values):  # type: ignore[no-untyped-def]
    for each in values:  # noqa: SIM110 - numba compiles no generators
        if each != 0.0:
            return True
    return False


@fused
def _of_units(joint, balance, work):  # type: ignore[no-untyped-def]
    """Fills `units` with φ of a joint, in the order of `workspace.KINDS`."""
    angle, speed = joint_state(joint, work)
    acceleration, below = work.acceleration[joint], work.below[joint]
    if below >= 0:
        acceleration -= work.acceleration[below]
    bent, by_angle = angle - balance.straight[joint], 0.0
    if balance.presliding > 0.0:
        by_angle = -balance.dry[joint] * builds_up(joint, balance, work)
    cosine, sine = work.teeth[0, joint], work.teeth[1, joint]
    teeth = balance.cogging[1, joint] * cosine - balance.cogging[0, joint] * sine
    spring, units = balance.spring[joint] + balance.cogging[2, joint] * teeth, work.units
    units[0], units[1], units[2] = -speed, -work.slip[2, joint], -bent
    units[3], units[4], units[5] = cosine, sine, -acceleration
    units[6], units[7] = -spring, -spring - by_angle
    units[8] = -balance.dry[joint] * by_presliding(joint, balance, work)
