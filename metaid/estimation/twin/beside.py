"""The derivative of one step of a twin by what is unknown beside the robot, compiled: further torques, and what joints
have.

In Eq. 23 each such unknown p has a torque in some joints as its Y_p. That of joint i is Σ_k φ_ik K_ikp, with φ_ik what
the state makes of a unit of a kind k, and K_ikp how much of it the unknown has. Where links lean, G of Eq. 23 says what
that does, but for joints, which do not.
"""

from __future__ import annotations

import numpy as np

from metaid.compiled import fused
from metaid.estimation.twin.joints import builds_up, by_presliding, joint_state, lever
from metaid.estimation.twin.kernels import turn_base


@fused
def force_beside(step, balance, beside, work):  # type: ignore[no-untyped-def]
    """Adds to `changed` what is unknown beside the robot.

    Args:
        step: that begins, from 0.
        balance: what the motion follows from, of a kernel.
        beside, work: see `workspace`; `solved` as `linearise` has filled it.
    """
    n, ntorque, count = beside.by_kind.shape[0], beside.torques.shape[0], beside.by_kind.shape[2]
    for column in range(ntorque):
        for i in range(n):
            torque = beside.torques[column, step, i]
            if torque != 0.0:
                for r in range(n):
                    work.changed[r, beside.first + column] += lever(r, i, work) * torque
    if count == 0:
        return
    first, turning = beside.first + ntorque, work.turning[:count]
    for i in range(n):
        _of_units(i, balance, work)
        turning[:] = 0.0
        for k in range(work.units.shape[0]):
            unit, share = work.units[k], beside.by_kind[i, k]
            for p in range(count):
                turning[p] += unit * share[p]
        lean = beside.lean[i]
        for r in range(n):
            own, turned, row = lever(r, i, work), work.solved[r, n + i], work.changed[r, first : first + count]
            for p in range(row.shape[0]):
                row[p] += own * turning[p] + turned * lean[p]
    turn_base(balance, beside, work)


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
    phase = balance.cogging[2, joint] * bent
    cosine, sine = np.cos(phase), np.sin(phase)
    teeth = balance.cogging[1, joint] * cosine - balance.cogging[0, joint] * sine
    spring, units = balance.spring[joint] + balance.cogging[2, joint] * teeth, work.units
    units[0], units[1], units[2] = -speed, -work.slip[2, joint], -bent
    units[3], units[4], units[5] = cosine, sine, -acceleration
    units[6], units[7] = -spring, -spring - by_angle
    units[8] = -balance.dry[joint] * by_presliding(joint, balance, work)
