"""The twin's counters: how often each joint has crossed the upright by the end of each window.

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

from metaid.estimation.log_unknowns import LogUnknowns
from metaid.estimation.trials import WatchedTrial
from metaid.estimation.twin import twin_of
from metaid.models import Array

MISS, TOP = 0, 1  # rows of `touches`


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
    ends, twin = trial.ends[:windows], twin_of(unknowns, log_factors)
    wanted = np.full(len(trial.starts), ends[-1] + 1)
    every = (twin if slopes else twin.alone).follow(trial, np.arange(ends[-1] + 1), wanted)
    angles, speeds, by_angle, by_speed = (each.swapaxes(0, 1) for each in every[:4])
    side = _sides(angles, speeds)
    crossed = side[1:] != side[:-1]
    last = side[ends]
    states = np.stack([last * angles[ends], last * speeds[ends]], axis=2)
    state_slopes = np.stack([last[..., None] * each[ends] for each in (by_angle, by_speed)], axis=2)
    touches, touch_slopes = np.full(states.shape, np.inf), np.zeros(state_slopes.shape)
    height = side * angles
    for kind, extrema, until in _extrema(height, side * speeds, speeds, crossed):
        order = np.argsort(-height[extrema])  # of what is written to one place the last stays, the least
        step, push, joint = (each[order] for each in extrema)
        at = np.searchsorted(ends, until[order]), push, kind, joint
        touches[at] = height[step, push, joint]
        touch_slopes[at] = side[step, push, joint][:, None] * by_angle[step, push, joint]
    counts = np.cumsum(crossed, axis=0)[ends - 1]
    shown = (each.swapaxes(0, 1) for each in (states, state_slopes, touches, touch_slopes))
    return Counters(counts.swapaxes(0, 1), *shown), every.windows_reached(ends)


def _sides(angles: Array, speeds: Array) -> Array:
    """The side of the upright that each joint is on after each step (nstep + 1 x npush x njoint), by its angles and
    speeds: where it is exactly upright, the one before; at first the one that it was pushed to, 0 of one at rest.
    """
    side = np.sign(angles)
    side[0] = np.sign(speeds[0])
    steps = np.arange(len(side))[:, None, None]
    known = np.maximum.accumulate(np.where(side != 0.0, steps, 0))
    return np.asarray(np.take_along_axis(side, known, 0) * (side[0] != 0.0))


def _extrema(
    height: Array, outward: Array, speeds: Array, crossed: NDArray[np.bool_]
) -> Iterator[tuple[int, tuple[NDArray[np.intp], ...], NDArray[np.intp]]]:
    """Where joints are nearest to touching the upright: for each row of `touches` the steps, pushes and joints (n
    each), and the steps that show it (n).

    Args:
        height: angles (nstep + 1 x npush x njoint), positive on the side that a joint is on.
        outward: speeds away from the upright (nstep + 1 x npush x njoint).
        speeds: of the joints (nstep + 1 x npush x njoint).
        crossed: which joints cross in each step (nstep x npush x njoint).
    """
    extrema = np.nonzero(speeds[1:] * speeds[:-1] < 0.0)
    is_top = outward[extrema] > 0.0
    misses = tuple(each[~is_top] for each in extrema)
    yield MISS, misses, misses[0] + 1
    tops = tuple(each[is_top] for each in extrema)
    before: NDArray[np.int64] = np.cumsum(crossed, axis=0) - crossed  # how often a joint has crossed before each step
    highest, order = np.full((before.max() + 1, *crossed.shape[1:]), -1), np.argsort(height[tops])
    highest[before[tops][order], tops[1][order], tops[2][order]] = tops[0][order]
    step, *own = np.nonzero(crossed)
    top = highest[before[crossed], *own]
    is_known = top >= 0
    yield TOP, tuple(each[is_known] for each in (top, *own)), step[is_known] + 1
