"""The derivative of one step of the twin by what is unknown beside the lumps, compiled: further torques, and what
joints have.

In Eq. 23 each such unknown p has a torque in some joints as its Y_p. That of joint i is Σ_k φ_ik K_ikp, with φ_ik what
the state makes of a unit of a kind k, and K_ikp how much of it the unknown has. Where links lean, G of Eq. 23 says what
that does, but for joints, which do not.
"""

from __future__ import annotations

import numpy as np

from metaid.compiled import fused
from metaid.estimation.tangent import builds_up
from metaid.models import SLIDING


@fused
def force_beside(step, balance, beside, work):  # type: ignore[no-untyped-def]
    """Adds to `changed` what is unknown beside the lumps.

    Args:
        step: that begins, from 0.
        balance, beside, work: see `workspace`; `solved` as `linearise` has filled it.
    """
    n, ntorque, count = beside.by_kind.shape[0], beside.torques.shape[0], beside.by_kind.shape[2]
    for column in range(ntorque):
        for i in range(n):
            torque = beside.torques[column, step, i]
            if torque != 0.0:
                for r in range(n):
                    work.changed[r, beside.first + column] += _lever(r, i, work) * torque
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
            lever, turned, row = _lever(r, i, work), work.solved[r, n + i], work.changed[r, first : first + count]
            for p in range(row.shape[0]):
                row[p] += lever * turning[p] + turned * lean[p]


@fused
def slip_beside(joint, balance, beside, work):  # type: ignore[no-untyped-def]
    """Adds to `slipped` what the share of dry friction in a joint has changed by, by the way over which it builds up.

    Args:
        joint: which, from 0.
        balance, beside, work: see `workspace`; `slip` is as it is after the step.
    """
    change, count = _by_presliding(joint, balance, work), beside.by_kind.shape[2]
    first = beside.first + beside.torques.shape[0]
    row, share = work.slipped[joint, first : first + count], beside.by_kind[joint, work.units.shape[0] - 1]
    for p in range(row.shape[0]):
        row[p] += change * share[p]


@fused
def _lever(link, joint, work):  # type: ignore[no-untyped-def]
    """The acceleration of a link by a torque of 1 N m in a joint."""
    return work.solved[link, joint] - (work.solved[link, joint - 1] if joint > 0 else 0.0)


@fused
def _of_units(joint, balance, work):  # type: ignore[no-untyped-def]
    """Fills `units` with φ of a joint, in the order of `workspace.KINDS`."""
    angle, speed, acceleration = work.angle[joint], work.speed[joint], work.acceleration[joint]
    if joint > 0:
        angle -= work.angle[joint - 1]
        speed -= work.speed[joint - 1]
        acceleration -= work.acceleration[joint - 1]
    bent, share, by_angle = angle - balance.straight[joint], min(max(speed * (1.0 / SLIDING), -1.0), 1.0), 0.0
    if balance.presliding > 0.0:
        share, by_angle = work.slip[2, joint], -balance.dry[joint] * builds_up(joint, speed, balance, work)
    phase = balance.cogging[2, joint] * bent
    cosine, sine = np.cos(phase), np.sin(phase)
    teeth = balance.cogging[1, joint] * cosine - balance.cogging[0, joint] * sine
    spring, units = balance.spring[joint] + balance.cogging[2, joint] * teeth, work.units
    units[0], units[1], units[2] = -speed, -share, -bent
    units[3], units[4], units[5] = cosine, sine, -acceleration
    units[6], units[7] = -spring, -spring - by_angle
    units[8] = -balance.dry[joint] * _by_presliding(joint, balance, work)


@fused
def _by_presliding(joint, balance, work):  # type: ignore[no-untyped-def]
    """The derivative of the share of dry friction in a joint by the way over which it builds up, in 1/rad."""
    if balance.presliding == 0.0:
        return 0.0
    below = work.angle[joint - 1] if joint > 0 else 0.0
    moved = work.angle[joint] - below - work.slip[1, joint]
    return (work.slip[2, joint] - np.sign(moved)) * abs(moved) / balance.presliding**2
