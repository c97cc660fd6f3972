"""What changes of the motion of a planar chain (Eq. 22) with its state and with each unknown of the chain, compiled."""

from __future__ import annotations

from metaid.compiled import fused
from metaid.estimation.twin.joints import slopes_of_joints
from metaid.models import SLIDING


@fused
def linearise(balance, work):  # type: ignore[no-untyped-def]
    """Fills `solved` (nlink x 3 nlink) with M⁻¹ [1 G H]."""
    _slopes_of_forces(balance, work)
    slopes_of_joints(balance, work)
    factors, solved = work.own.factors, work.solved
    n = factors.shape[0]
    for i in range(n):
        row = solved[i]
        for k in range(i):
            factor, other = factors[i, k], solved[k]
            for p in range(row.shape[0]):
                row[p] -= factor * other[p]
    for i in range(n - 1, -1, -1):
        row, scale = solved[i], 1.0 / factors[i, i]
        for p in range(row.shape[0]):
            row[p] *= scale
        for k in range(i + 1, n):
            factor, other = factors[k, i], solved[k]
            for p in range(row.shape[0]):
                row[p] -= factor * other[p]


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
def force_by_unknowns(derivatives, work):  # type: ignore[no-untyped-def]
    """Fills `changed` (nlink x nunknown) with M⁻¹ Y. What is known has the column −1."""
    speed, acceleration, sine = work.speed, work.acceleration, work.own.sine
    gravity_column, length_column, inertia_column, damping_column, coulomb_column, begin = derivatives.columns
    n = speed.shape[0]
    _pull_by_coriolis(derivatives, work)
    work.changed[:] = 0.0
    for r in range(n):
        row, inverse = work.changed[r], work.solved[r]
        for i in range(n):
            if gravity_column >= 0:
                row[gravity_column + i] += inverse[i] * sine[i] * derivatives.gravity[i]
            if inertia_column >= 0:
                row[inertia_column + i] -= inverse[i] * acceleration[i] * derivatives.inertia[i]
            if begin >= 0 and i < n - 1:
                by_length = _add_pulls(i, inverse, work.own.pulls, row[begin + i + 1 : begin + n])
                if length_column >= 0:
                    row[length_column + i] += by_length
            if damping_column >= 0 or coulomb_column >= 0:
                joint_speed, lever = speed[i], inverse[i]
                if i > 0:
                    joint_speed -= speed[i - 1]
                    lever -= inverse[i - 1]
                if damping_column >= 0:
                    row[damping_column + i] -= lever * joint_speed * derivatives.damping[i]
                if coulomb_column >= 0:
                    share = min(max(joint_speed * (1.0 / SLIDING), -1.0), 1.0)
                    row[coulomb_column + i] -= lever * share * derivatives.coulomb[i]


@fused
def _add_pulls(i, inverse, pulls, by_gravity):  # type: ignore[no-untyped-def]
    """Adds what the lumps a_ij of link i do to one link, by its row of the `inverse` of M, to the derivatives
    `by_gravity` lumps j > i (nlink − 1 − i); returns their sum, the derivative by the length of link i.
    """
    n, total = inverse.shape[0] // 3, 0.0
    own, other = pulls[i, i + 1 :], pulls[n + i, i + 1 :]
    outer, weight = inverse[i + 1 : n], inverse[i]
    for p in range(by_gravity.shape[0]):
        pull = weight * own[p] + outer[p] * other[p]
        by_gravity[p] += pull
        total += pull
    return total


@fused
def _pull_by_coriolis(derivatives, work):  # type: ignore[no-untyped-def]
    """Fills `pulls` (2 nlink x nlink): in row i what the lumps a_ij, i < j, turn link i with, and nlink rows below
    what they turn link j with.
    """
    speed, acceleration, cosine, sine = work.speed, work.acceleration, work.own.cosine, work.own.sine
    n = speed.shape[0]
    for i in range(n):
        for j in range(i + 1, n):
            lump = derivatives.coriolis[i, j]
            difference = sine[i] * cosine[j] - cosine[i] * sine[j]
            common = cosine[i] * cosine[j] + sine[i] * sine[j]
            work.own.pulls[i, j] = -lump * (difference * speed[j] * speed[j] + common * acceleration[j])
            work.own.pulls[n + i, j] = lump * (difference * speed[i] * speed[i] - common * acceleration[i])
