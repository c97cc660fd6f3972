"""The derivative of one step of the twin by every unknown, compiled. With Eq. 22 of `motion`, that of an unknown p is

    δα = M⁻¹ (G δφ + H δω + Y_p),    δω ← δω + h δα,    δφ ← δφ + h δω                                   (23)

G = ∂(F − M α)/∂φ with α held, H = ∂F/∂ω, and Y_p = ∂(F − M α)/∂p with the state held. So the derivative is
exact for the discrete motion. All unknowns share M⁻¹G and M⁻¹H, so a step costs 2 nlink² multiplications an unknown,
in loops over neighbouring unknowns.

Loops run along slices. Only of a slice does the compiler know that no index is negative, and only then does it use
vector instructions.
"""

from __future__ import annotations

import numpy as np

from metaid.compiled import fused
from metaid.estimation.workspace import BLOCK
from metaid.models import SLIDING

TILE = 512  # unknowns that a step treats together, so that their derivatives stay in the nearer caches


@fused
def linearise(balance, work):  # type: ignore[no-untyped-def]
    """Fills `solved` (nlink x 3 nlink) with M⁻¹ [1 G H]."""
    _slopes_of_forces(balance, work)
    _slopes_of_joints(balance, work)
    factors, solved = work.factors, work.solved
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
    cosine, sine, n = work.cosine, work.sine, work.angle.shape[0]
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
def _slopes_of_joints(balance, work):  # type: ignore[no-untyped-def]
    """Adds to H what friction in joint i does to link i, and the other way to link i − 1; to G what springs and
    cogging do.
    """
    speed, solved = work.speed, work.solved
    n = speed.shape[0]
    for i in range(n):
        joint_speed = speed[i] - (speed[i - 1] if i > 0 else 0.0)
        slope, spring = balance.damping[i], balance.spring[i]
        slope += balance.coulomb[i] / SLIDING if abs(joint_speed) < SLIDING else 0.0
        if balance.cogging[2, i] != 0.0:
            joint_angle = work.angle[i] - (work.angle[i - 1] if i > 0 else 0.0)
            phase = balance.cogging[2, i] * (joint_angle - balance.straight[i])
            by_phase = balance.cogging[1, i] * np.cos(phase) - balance.cogging[0, i] * np.sin(phase)
            spring += balance.cogging[2, i] * by_phase
        if balance.dry[i] != 0.0:
            spring -= balance.dry[i] * builds_up(i, joint_speed, balance, work)
        solved[i, 2 * n + i] += slope
        solved[i, n + i] += spring
        if i > 0:
            solved[i, 2 * n + i - 1] -= slope
            solved[i - 1, 2 * n + i] -= slope
            solved[i - 1, 2 * n + i - 1] += slope
            solved[i, n + i - 1] -= spring
            solved[i - 1, n + i] -= spring
            solved[i - 1, n + i - 1] += spring


@fused
def builds_up(joint, joint_speed, balance, work):  # type: ignore[no-untyped-def]
    """The derivative of the share of dry friction in a joint by its angle, in 1/rad.

    Args:
        joint: which, from 0.
        joint_speed: in rad/s.
        balance, work: see `workspace`; `slip` is as the force was.
    """
    moved = work.angle[joint] - (work.angle[joint - 1] if joint > 0 else 0.0) - work.slip[1, joint]
    goal = np.sign(moved) if moved != 0.0 else np.sign(joint_speed)
    return goal * (goal - work.slip[2, joint]) / balance.presliding


@fused
def force_by_unknowns(derivatives, work):  # type: ignore[no-untyped-def]
    """Fills `changed` (nlink x nunknown) with M⁻¹ Y. What is known has the column −1."""
    speed, acceleration, sine = work.speed, work.acceleration, work.sine
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
                by_length = _add_pulls(i, inverse, work.pulls, row[begin + i + 1 : begin + n])
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
    speed, acceleration, cosine, sine = work.speed, work.acceleration, work.cosine, work.sine
    n = speed.shape[0]
    for i in range(n):
        for j in range(i + 1, n):
            lump = derivatives.coriolis[i, j]
            difference = sine[i] * cosine[j] - cosine[i] * sine[j]
            common = cosine[i] * cosine[j] + sine[i] * sine[j]
            work.pulls[i, j] = -lump * (difference * speed[j] * speed[j] + common * acceleration[j])
            work.pulls[n + i, j] = lump * (difference * speed[i] * speed[i] - common * acceleration[i])


@fused
def move_tangent(timestep, stiffness, with_energies, work):  # type: ignore[no-untyped-def]
    """One step of Eq. 23.

    Args:
        timestep: in s.
        stiffness: of the law, in 1/s².
        with_energies: whether the derivatives of the energies are kept, too.
        work: see `workspace.Workspace`; `changed` is M⁻¹ Y and becomes δα, and `moved`, which is δφ above δω, is moved
            on by the step.
    """
    moved, changed = work.moved, work.changed
    n = work.solved.shape[0]
    _close(work)
    for low in range(0, changed.shape[1], TILE):
        high = min(low + TILE, changed.shape[1])
        _multiply(work.closed, moved, changed, low, high)
        if with_energies:
            _add_energy_slopes(timestep, stiffness, low, high, work)
        for i in range(n):
            row, angle_row, speed_row = changed[i, low:high], moved[i, low:high], moved[n + i, low:high]
            for p in range(row.shape[0]):
                speed_row[p] += timestep * row[p]
                angle_row[p] += timestep * speed_row[p]


@fused
def accelerate_tangent(work):  # type: ignore[no-untyped-def]
    """Makes δα of `changed`, which is M⁻¹ Y, at the `moved` that is.  Eq. 23."""
    _close(work)
    for low in range(0, work.changed.shape[1], TILE):
        _multiply(work.closed, work.moved, work.changed, low, min(low + TILE, work.changed.shape[1]))


@fused
def _close(work):  # type: ignore[no-untyped-def]
    """Fills `closed` with M⁻¹ [G H], in rows and columns that are multiples of BLOCK."""
    n = work.solved.shape[0]
    for i in range(n):
        for j in range(2 * n):
            work.closed[i, j] = work.solved[i, n + j]


@fused
def _multiply(closed, moved, changed, low, high):  # type: ignore[no-untyped-def]
    """Adds `closed` times `moved` to `changed`, in the columns from `low` to below `high`. Rows are multiples of
    BLOCK: a block's sixteen numbers stay in registers while its loop runs along the unknowns.
    """
    for r in range(0, closed.shape[0], BLOCK):
        row0, row1 = changed[r, low:high], changed[r + 1, low:high]
        row2, row3 = changed[r + 2, low:high], changed[r + 3, low:high]
        for j in range(0, closed.shape[1], BLOCK):
            from0, from1 = moved[j, low:high], moved[j + 1, low:high]
            from2, from3 = moved[j + 2, low:high], moved[j + 3, low:high]
            a0, a1, a2, a3 = closed[r, j], closed[r, j + 1], closed[r, j + 2], closed[r, j + 3]
            b0, b1, b2, b3 = closed[r + 1, j], closed[r + 1, j + 1], closed[r + 1, j + 2], closed[r + 1, j + 3]
            c0, c1, c2, c3 = closed[r + 2, j], closed[r + 2, j + 1], closed[r + 2, j + 2], closed[r + 2, j + 3]
            d0, d1, d2, d3 = closed[r + 3, j], closed[r + 3, j + 1], closed[r + 3, j + 2], closed[r + 3, j + 3]
            for p in range(row0.shape[0]):
                x, y, z, w = from0[p], from1[p], from2[p], from3[p]
                row0[p] += a0 * x + a1 * y + a2 * z + a3 * w
                row1[p] += b0 * x + b1 * y + b2 * z + b3 * w
                row2[p] += c0 * x + c1 * y + c2 * z + c3 * w
                row3[p] += d0 * x + d1 * y + d2 * z + d3 * w


@fused
def _add_energy_slopes(timestep, stiffness, low, high, work):  # type: ignore[no-untyped-def]
    """Adds what this step has of the derivatives of both energies by the unknowns from `low` to below `high`."""
    angle, speed, acceleration, moved, changed = work.angle, work.speed, work.acceleration, work.moved, work.changed
    n = angle.shape[0]
    for i in range(n):
        joint_speed, deviation = speed[i], acceleration[i] + stiffness * angle[i]
        if i > 0:
            joint_speed -= speed[i - 1]
            deviation -= acceleration[i - 1] + stiffness * angle[i - 1]
        twice_speed, twice_deviation = 2.0 * timestep * joint_speed, 2.0 * timestep * deviation
        by_speed, by_deviation = work.speed_slopes[i, low:high], work.acceleration_slopes[i, low:high]
        row, angle_row, speed_row = changed[i, low:high], moved[i, low:high], moved[n + i, low:high]
        if i == 0:
            for p in range(by_speed.shape[0]):
                by_speed[p] += twice_speed * speed_row[p]
                by_deviation[p] += twice_deviation * (row[p] + stiffness * angle_row[p])
        else:
            below, angle_below = changed[i - 1, low:high], moved[i - 1, low:high]
            speed_below = moved[n + i - 1, low:high]
            for p in range(by_speed.shape[0]):
                by_speed[p] += twice_speed * (speed_row[p] - speed_below[p])
                by_deviation[p] += twice_deviation * (row[p] - below[p] + stiffness * (angle_row[p] - angle_below[p]))
