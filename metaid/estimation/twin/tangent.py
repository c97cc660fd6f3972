"""The derivative of one step of a twin by every unknown, compiled. With M α = F, that of an unknown p is

    δα = M⁻¹ (G δφ + H δω + Y_p),    δω ← δω + h δα,    δφ ← δφ + h δω                                   (23)

G = ∂(F − M α)/∂φ with α held, H = ∂F/∂ω, and Y_p = ∂(F − M α)/∂p with the state held, as the kernel has them. So the
derivative is that of the discrete motion. All unknowns share M⁻¹G and M⁻¹H, so a step costs 2 njoint² multiplications
an unknown, in loops over neighbouring unknowns.
"""

from __future__ import annotations

from metaid.compiled import fused, multiply
from metaid.estimation.twin.joints import pull_levers


@fused
def accelerate_tangent(work):  # type: ignore[no-untyped-def]
    """Makes δα of `changed`, which is M⁻¹ Y, at the `moved` that is, δφ above δω.  Eq. 23."""
    _close(work)
    multiply(work.closed, work.moved, work.changed, 0, work.changed.shape[1])


@fused
def move_tangent(timestep, work):  # type: ignore[no-untyped-def]
    """Moves `moved` on by a step of Euler's with δα, which is in `changed`.  Eq. 23."""
    n = work.solved.shape[0]
    for i in range(n):
        row, angle_row, speed_row = work.changed[i], work.moved[i], work.moved[n + i]
        for p in range(row.shape[0]):
            speed_row[p] += timestep * row[p]
            angle_row[p] += timestep * speed_row[p]


@fused
def _close(work):  # type: ignore[no-untyped-def]
    """Fills `closed` with M⁻¹ [G H], in rows and columns that are multiples of BLOCK."""
    n = work.solved.shape[0]
    for i in range(n):
        for j in range(2 * n):
            work.closed[i, j] = work.solved[i, n + j]


@fused
def carry(timestep, is_continuous, spread, work):  # type: ignore[no-untyped-def]
    """Moves the `step` of a filter, and how far it is `pushed` by torques that are held, on by the linearised step of
    Eq. 23.

    Args:
        timestep: in s.
        is_continuous: whether the plant moves continuously.
        spread: of the filter.
        work: see `workspace.Workspace`.
    """
    pushed, n = spread.pushed, work.angle.shape[0]
    moved = (0.5 if is_continuous else 1.0) * timestep * timestep
    _carry(spread.step, timestep, spread, work)
    _carry(pushed, timestep, spread, work)
    pull_levers(work)
    for i in range(n):
        for j in range(n):
            pushed[n + i, j] += timestep * work.levers[i, j]
            pushed[i, j] += moved * work.levers[i, j]


@fused
def _carry(columns, timestep, spread, work):  # type: ignore[no-untyped-def]
    """Moves the `columns` (2n x any) on by A of that step."""
    n, solved, changed = work.angle.shape[0], work.solved, spread.changed
    for i in range(n):
        for p in range(columns.shape[1]):
            changed[i, p] = 0.0
        for j in range(2 * n):
            slope = solved[i, n + j]
            for p in range(columns.shape[1]):
                changed[i, p] += slope * columns[j, p]
    for i in range(n):
        for p in range(columns.shape[1]):
            columns[n + i, p] += timestep * changed[i, p]
            columns[i, p] += timestep * columns[n + i, p]
