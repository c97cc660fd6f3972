"""What changes of the motion of a planar chain (Eq. 22) with its state and with each unknown of the chain, compiled."""

from __future__ import annotations

from metaid.compiled import fused, solve_rows
from metaid.estimation.twin.joints import joint_state, slopes_of_joints
from metaid.models import SLIDING


@fused
def linearise(balance, work):  # type: ignore[no-untyped-def]
    """Fills `solved` (nlink x 3 nlink) with M⁻¹ [1 G H]."""
    _slopes_of_forces(balance, work)
    slopes_of_joints(balance, work)
    solve_rows(work.own.factor, work.solved)


@fused
def _slopes_of_forces(balance, work):  # type: ignore[no-untyped-def]
    """Fills `solved` (nlink x 3 nlink) with [1 G H], friction left out. The diagonals of ã and a are zero."""
    angle, speed, acceleration, solved = work.angle, work.speed, work.acceleration, work.solved
    cosine, sine, n = work.own.cosine, work.own.sine, work.angle.shape[0]
    for i in range(n):
        own = -balance.gravity[i] * cosine[i] - balance.stiffness * balance.law_inertia[i]
        for j in range(n):
            difference = sine[i] * cosine[j] - cosine[i] * sine[j]
            common = cosine[i] * cosine[j] + sine[i] * sine[j]
            stiffness_term = balance.stiffness * balance.law_coriolis[i, j]  # k ã_ij of Eq. 13
            turned = balance.coriolis[i, j] * common * speed[j] * speed[j] + stiffness_term * difference * angle[j]
            turned += balance.mass_coriolis[i, j] * difference * acceleration[j]
            own += turned
            solved[i, j] = 0.0
            solved[i, n + j] = -turned - stiffness_term * common
            solved[i, 2 * n + j] = 2.0 * balance.coriolis[i, j] * difference * speed[j]
        solved[i, i] = 1.0
        solved[i, n + i] = own


@fused
def force_by_unknowns(_balance, derivatives, work):  # type: ignore[no-untyped-def]
    """Fills `changed` (nlink x nunknown) with M⁻¹ Y. What is known has the column −1."""
    acceleration, sine, changed, n = work.acceleration, work.own.sine, work.changed, work.angle.shape[0]
    gravity_column, length_column, inertia_column, damping_column, coulomb_column, begin = derivatives.columns
    changed[:] = 0.0
    for i in range(n):
        if gravity_column >= 0:
            changed[i, gravity_column + i] += sine[i] * derivatives.gravity[i]
        if inertia_column >= 0:
            changed[i, inertia_column + i] -= acceleration[i] * derivatives.inertia[i]
        if begin >= 0:
            _pull_by_coriolis(i, begin, length_column, derivatives, work)
        speed = joint_state(i, work)[1]
        if damping_column >= 0:
            _rub(i, speed * derivatives.damping[i], damping_column, changed)
        if coulomb_column >= 0:
            share = min(max(speed * (1.0 / SLIDING), -1.0), 1.0)
            _rub(i, share * derivatives.coulomb[i], coulomb_column, changed)
    solve_rows(work.own.factor, changed)


@fused
def _rub(i, torque, column, changed):  # type: ignore[no-untyped-def]
    """Takes a `torque` in joint i, whose unknown stands there behind the `column` of the first, from `changed`."""
    changed[i, column + i] -= torque
    if i > 0:
        changed[i - 1, column + i] += torque


@fused
def _pull_by_coriolis(i, gravity_column, length_column, derivatives, work):  # type: ignore[no-untyped-def]
    """Adds to `changed` what the lumps a_ij, i < j, pull links i and j with: by gravity lump j, and by length i."""
    speed, acceleration, cosine, sine = work.speed, work.acceleration, work.own.cosine, work.own.sine
    for j in range(i + 1, speed.shape[0]):
        lump = derivatives.coriolis[i, j]
        difference = sine[i] * cosine[j] - cosine[i] * sine[j]
        common = cosine[i] * cosine[j] + sine[i] * sine[j]
        own = -lump * (difference * speed[j] * speed[j] + common * acceleration[j])
        other = lump * (difference * speed[i] * speed[i] - common * acceleration[i])
        work.changed[i, gravity_column + j] += own
        work.changed[j, gravity_column + j] += other
        if length_column >= 0:
            work.changed[i, length_column + i] += own
            work.changed[j, length_column + i] += other


@fused
def turn_base(_balance, _beside, _work):  # type: ignore[no-untyped-def]
    """A base turns in the plane alone, as if all links leant."""
