"""The derivative of one step of a twin by every unknown, compiled. With M α = F, that of an unknown p is

    δα = M⁻¹ (G δφ + H δω + Y_p),    δω ← δω + h δα,    δφ ← δφ + h δω                                   (23)

G = ∂(F − M α)/∂φ with α held, H = ∂F/∂ω, and Y_p = ∂(F − M α)/∂p with the state held, as the kernel has them. So the
derivative is that of the discrete motion. All unknowns share M⁻¹G and M⁻¹H, so a step costs 2 njoint² multiplications
an unknown, in loops over neighbouring unknowns.
"""

from __future__ import annotations

from metaid.compiled import fused, multiply

TILE = 512  # unknowns that a step treats together, so that their derivatives stay in the nearer caches


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
        multiply(work.closed, moved, changed, low, high)
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
        multiply(work.closed, work.moved, work.changed, low, min(low + TILE, work.changed.shape[1]))


@fused
def _close(work):  # type: ignore[no-untyped-def]
    """Fills `closed` with M⁻¹ [G H], in rows and columns that are multiples of BLOCK."""
    n = work.solved.shape[0]
    for i in range(n):
        for j in range(2 * n):
            work.closed[i, j] = work.solved[i, n + j]


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
