"""The motion of a twin after one push, under the very law that was sent, and its derivative by every unknown, compiled.

A step is the simulated plant's, ω ← ω + h α and then φ ← φ + h ω. `tangent` has its derivative, Eq. 23.
"""

from __future__ import annotations

from metaid.compiled import compiled
from metaid.estimation.twin.joints import joint_slopes, joint_state
from metaid.estimation.twin.kernels import accelerate, force_by_unknowns, linearise
from metaid.estimation.twin.state import move, set_off
from metaid.estimation.twin.tangent import accelerate_tangent, move_tangent


@compiled
def watch_push(start, balance, derivatives, timestep, ends, work, shown):  # type: ignore[no-untyped-def]
    """Runs one push; returns how many of the `ends` it got to.

    Args:
        start: joint angles and speeds (2 x njoint) right after the push, in rad and rad/s.
        balance, derivatives: of a kernel.
        work: see `workspace`.
        timestep: in s.
        ends: the steps (nwindow) that are shown, of those that are wanted; the first may be 0.
        shown: joint angles and joint speeds (nwindow x njoint each), and derivatives of both (nwindow x njoint x
            nunknown each), filled in.
    """
    angles, speeds, by_angle, by_speed = shown
    n, window = start.shape[1], 0
    set_off(start, 0, 0, work)
    for step in range(ends[-1] + 1 if ends.shape[0] > 0 else 0):
        if step > 0:
            if not accelerate(balance, work):
                return window
            if work.moved.shape[1] > 0:
                linearise(balance, work)
                force_by_unknowns(balance, derivatives, work)
                accelerate_tangent(work)
                move_tangent(timestep, work)
            if not move(timestep, work):
                return window
        if step == ends[window]:
            for i in range(n):
                angles[window, i], speeds[window, i] = joint_state(i, work)
                joint_slopes(i, 0, by_angle[window, i], work)
                joint_slopes(i, n, by_speed[window, i], work)
            window += 1
    return window
