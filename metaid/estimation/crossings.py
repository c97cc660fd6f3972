"""The twin's counters: how often each joint has crossed the upright by the end of each window, compiled.

A count is an integer, and has no derivative. What it is made of has. With s the side of the upright that a joint is on,
the phase arctan(s ω q, s q̇) goes from 0 to π between two crossings. So the count is the number of whole half turns of
(q̇, ω q), whatever ω, and the phase is what has been turned beyond them. A count changes with a model for two reasons:
a crossing comes later or earlier than the end of a window, or two crossings come or go, where an extremum of q touches
the upright. The first is a change of phase. For the second the extrema nearest to the upright are kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import compiled, share_out
from metaid.estimation.log_unknowns import LogUnknowns
from metaid.estimation.trials import WatchedTrial
from metaid.estimation.twin.planar_motion import accelerate, planar_balance, planar_derivatives, planar_space
from metaid.estimation.twin.planar_slopes import force_by_unknowns, linearise
from metaid.estimation.twin.state import move, set_off
from metaid.estimation.twin.tangent import accelerate_tangent, move_tangent
from metaid.estimation.twin.workspace import workspace
from metaid.models import Array

MISS, TOP = 0, 1  # rows of `touches`
NO_FORCES = np.empty((0, 0))


class Counters(NamedTuple):
    """What one push shows to the end of each window.

    `counts` (nwindow x njoint): half periods. `states` (nwindow x 2 x njoint): q and q̇ times the side that the joint is
    on, so that q is not negative. `touches` (nwindow x 2 x njoint): the extremum of q within the window that is nearest
    to the upright, in rad, first of those where the joint turns back before it crosses, then of those between two
    crossings; infinite where there is none. The last two with their derivatives by the unknowns (... x nunknown).
    """

    counts: NDArray[np.int64]
    states: Array
    state_slopes: Array
    touches: Array
    touch_slopes: Array


class Crossing(NamedTuple):
    """What is known of each joint (njoint) while it is counted: the `side` that it is on, its `speed` a step ago, its
    `top` since the last crossing, in rad, with derivatives (njoint x nunknown).
    """

    side: Array
    speed: Array
    top: Array
    top_slopes: Array


def count_crossings(
    trial: WatchedTrial, unknowns: LogUnknowns, log_factors: Array, windows: int, slopes: bool
) -> tuple[Counters, NDArray[np.int64]]:
    """The counters of the twin in place of a trial, and how many windows of each push (npush) it got through.

    Args:
        trial: whose pushes and law the twin has.
        unknowns: of the twin.
        log_factors: of the unknowns (nunknown).
        windows: how many of the trial's first.
        slopes: whether there are derivatives by the unknowns.
    """
    lumps, (npush, n) = unknowns.lumps(log_factors), trial.start_speeds.shape
    nunknown = len(log_factors) * slopes
    ends = np.ascontiguousarray(trial.ends[:windows])
    forces = (
        planar_balance(trial.law, lumps, unknowns.gravity, float(np.max(trial.stiffness))),
        planar_derivatives(unknowns, lumps),
    )
    settled = NO_FORCES, *forces, trial.timestep, ends
    shown, reached = _counters(npush, windows, n, nunknown), np.zeros(npush, dtype=np.int64)

    def run(pushes: Iterator[int]) -> None:
        own = workspace(*planar_space(n), nunknown), _crossing(n, nunknown)
        for push in pushes:
            seen = tuple(each[push] for each in shown)
            reached[push] = _count_push(trial.starts[push], *settled, *own, seen)

    share_out(run, npush, npush * int(ends[-1]) * 2 * n * n * max(nunknown, 1))
    return shown, reached


def _counters(npush: int, nwindow: int, njoint: int, nunknown: int) -> Counters:
    """Empty ones, with a leading axis (npush).

    Args:
        npush: how many pushes.
        nwindow: windows of each push.
        njoint: joints of the chain.
        nunknown: unknowns, by which there are derivatives.
    """
    shape = npush, nwindow, 2, njoint
    return Counters(
        np.zeros((npush, nwindow, njoint), dtype=np.int64),
        np.zeros(shape),
        np.zeros((*shape, nunknown)),
        np.full(shape, np.inf),
        np.zeros((*shape, nunknown)),
    )


def _crossing(njoint: int, nunknown: int) -> Crossing:
    """Working space for one push at a time."""
    return Crossing(np.zeros(njoint), np.zeros(njoint), np.zeros(njoint), np.zeros((njoint, nunknown)))


@compiled
def _count_push(start, forces, balance, derivatives, timestep, ends, work, crossing, shown):  # type: ignore[no-untyped-def]
    """Runs one push; returns how many windows it got through.

    Args:
        start: joint angles and speeds (2 x njoint) right after it, in rad and rad/s.
        forces: beside the law, none: (0 x 0).
        balance, derivatives, work: see `workspace`.
        timestep: in s.
        ends: the steps (nwindow) that the windows end with.
        crossing: working space, see `Crossing`.
        shown: `Counters`, filled in.
    """
    set_off(start, 0, 0, work)
    side, before, top, _ = crossing
    for i in range(start.shape[1]):
        side[i], before[i], top[i] = np.sign(start[1, i]), start[1, i], 0.0
    window = 0
    for step in range(ends[-1]):
        if not accelerate(step, forces, balance, work):
            return window
        if work.moved.shape[1] > 0:
            linearise(balance, work)
            force_by_unknowns(derivatives, work)
            accelerate_tangent(work)
            move_tangent(timestep, work)
        if not move(timestep, work):
            return window
        for i in range(start.shape[1]):
            _watch_joint(i, window, timestep, work, crossing, shown)
        if step + 1 == ends[window]:
            _show(window, work, crossing, shown)
            window += 1
            if window < ends.shape[0]:
                for i in range(start.shape[1]):
                    shown[0][window, i] = shown[0][window - 1, i]
    return window


@compiled
def _watch_joint(i, window, timestep, work, crossing, shown):  # type: ignore[no-untyped-def]
    """Counts joint i after a step, and keeps its extrema that are nearest to the upright."""
    counts, _, _, touches, touch_slopes = shown
    side, before, top, top_slopes = crossing
    angle, speed = _joint(i, work.angle), _joint(i, work.speed)
    if speed * before[i] < 0.0:  # the angle a step ago was an extremum
        height = side[i] * (angle - timestep * speed)
        if before[i] * side[i] > 0.0:
            if height > top[i]:
                top[i] = height
                _slope_a_step_ago(i, side[i], timestep, work, top_slopes[i])
        elif height < touches[window, MISS, i]:
            touches[window, MISS, i] = height
            _slope_a_step_ago(i, side[i], timestep, work, touch_slopes[window, MISS, i])
    if angle * side[i] < 0.0:
        counts[window, i] += 1
        side[i] = -side[i]
        if top[i] < touches[window, TOP, i]:
            touches[window, TOP, i] = top[i]
            for p in range(top_slopes.shape[1]):
                touch_slopes[window, TOP, i, p] = top_slopes[i, p]
        top[i] = 0.0
    before[i] = speed


@compiled
def _joint(i, links):  # type: ignore[no-untyped-def]
    """What joint i has of what the `links` (nlink) have, absolute."""
    return links[i] - links[i - 1] if i > 0 else links[i]


@compiled
def _slope_a_step_ago(i, side, timestep, work, slope):  # type: ignore[no-untyped-def]
    """Fills in the derivative of joint i's angle a step ago, times its side, by the unknowns (nunknown)."""
    n = work.angle.shape[0]
    for p in range(slope.shape[0]):
        own = work.moved[i, p] - timestep * work.moved[n + i, p]
        below = work.moved[i - 1, p] - timestep * work.moved[n + i - 1, p] if i > 0 else 0.0
        slope[p] = side * (own - below)


@compiled
def _show(window, work, crossing, shown):  # type: ignore[no-untyped-def]
    """Fills in the states of the joints at the end of a window."""
    _, states, state_slopes, _, _ = shown
    n = work.angle.shape[0]
    for i in range(n):
        side = crossing.side[i]
        states[window, 0, i] = side * _joint(i, work.angle)
        states[window, 1, i] = side * _joint(i, work.speed)
        for row in range(2):
            slope, own, below = (
                state_slopes[window, row, i],
                work.moved[n * row + i],
                work.moved[n * row + max(i - 1, 0)],
            )
            for p in range(slope.shape[0]):
                slope[p] = side * (own[p] - below[p]) if i > 0 else side * own[p]
