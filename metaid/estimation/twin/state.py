"""The state of a twin: where a push sets it off, and where a step of Euler's takes it, compiled."""

from __future__ import annotations

import numpy as np

from metaid.compiled import compiled


@compiled
def set_off(start, start_column, extra, work):  # type: ignore[no-untyped-def]
    """Sets the twin on its way. Nothing depends on an unknown, but what is unknown of the start.

    Args:
        start: joint angles and speeds (2 x njoint), in rad and rad/s, and with which share dry friction begins
            (3 x njoint); by default with all of it, against the speed.
        start_column: of the first unknown of the start.
        extra: how many of the last numbers of the start are unknown.
        work: see `workspace.Workspace`.
    """
    n = start.shape[1]
    for i in range(n):
        angle, speed, below = start[0, i], start[1, i], work.below[i]
        if below >= 0:
            angle, speed = work.angle[below] + angle, work.speed[below] + speed
        work.angle[i], work.speed[i] = angle, speed
        work.start[i] = angle
        work.slip[0, i] = start[2, i] if start.shape[0] == 3 else np.sign(start[1, i])
    work.moved[:] = 0.0
    work.slipped[:] = 0.0
    for column in range(extra):
        kind, joint = divmod(start.shape[0] * n - extra + column, n)
        if kind == 2:
            work.slipped[joint, start_column + column] = 1.0
            continue
        for i in range(joint, n):  # a joint turns every link above it
            if i == joint or work.below[i] >= 0:
                work.moved[kind * n + i, start_column + column] = 1.0


@compiled
def move(timestep, work):  # type: ignore[no-untyped-def]
    """Euler's step; False beyond a radian a step, where nothing is simulated any more, and for NaN."""
    for i in range(work.angle.shape[0]):
        work.speed[i] += timestep * work.acceleration[i]
        work.angle[i] += timestep * work.speed[i]
        if not abs(work.speed[i]) * timestep <= 1.0:
            return False
    return True
