"""Faults whose derivatives say nothing from none on, so some guesses are tried by one linear fit each: how many times a
turn cogging repeats, and at what torque motors cut off.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from metaid.estimation.noisy.innovations import Innovations
from metaid.estimation.noisy.unmodelled import by_chance, least_squares
from metaid.estimation.trials import ReadTrial
from metaid.models import Array

FEWEST, MOST = 3, 40  # times a turn; of fewer gravity, a tilt and a spring have as much
LEVELS = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)  # of the largest torque that was commanded: where it may be cut off
HELD = 0.5  # of what is beyond a limit: a joint that lacks less of it has none


def teeth_shown(led: Innovations, point: Array) -> int:
    """How many times a turn the torque repeats, in each joint with an amplitude and a phase of its own, that leaves
    least of the innovations beside unknowns that may change with it; 0 where the twin cannot follow.  Eq. 42.

    Args:
        led: of all trials, with gains.
        point: the unknowns, with what concerns a push alone behind them.
    """
    left = _left_by_each(led, point, [_waves(trial) for trial in led.trials], 2 * led.unknowns.njoint)
    return FEWEST + int(np.argmin([each for each, _ in left[1:]])) if left else 0


def limits_shown(led: Innovations, point: Array) -> Array | None:
    """What the motors give at most (njoint), in N m, by the level that leaves least of the innovations, the same share
    of what was commanded in each joint; where a joint has none, the largest that was commanded. None where all have
    none, or the twin cannot follow.

    Args:
        led: of all trials, with gains.
        point: the unknowns, with what concerns a push alone behind them.
    """
    n = led.unknowns.njoint
    most = np.max([np.abs(trial.torques).max(axis=(0, 1)) for trial in led.trials], axis=0)
    left = _left_by_each(led, point, [_beyond(trial, most) for trial in led.trials], n)
    if not left:
        return None
    best = 1 + int(np.argmin([each for each, _ in left[1:]]))
    is_cut = left[best][1] > HELD
    if not is_cut.any() or left[0][0] - left[best][0] < by_chance(n):
        return None
    return np.asarray(np.where(is_cut, LEVELS[best - 1], 1.0) * most)


def _left_by_each(led: Innovations, point: Array, columns: Sequence[Array], each: int) -> list[tuple[float, Array]]:
    """The sum of squares that is left without further torques, and with every `each` of the `columns` (ncolumn x npush
    x nstep x njoint of each trial), with their sizes (each); nothing where the twin cannot follow.
    """
    residuals = led.residuals_with(point, columns)
    if residuals is None:
        return []
    count = len(led.spreads)
    prior = np.diag(np.append(1.0 / led.spreads, np.zeros(len(columns[0]))))[:count]
    slopes = np.vstack([residuals.slopes, prior])
    values = np.append(residuals.values, point[:count] / led.spreads)
    found = [(least_squares(slopes[:, :count], values)[0], np.empty(0))]
    for first in range(count, slopes.shape[1], each):
        left, step, _ = least_squares(np.column_stack([slopes[:, :count], slopes[:, first : first + each]]), values)
        found.append((left, step[count:]))
    return found


def _waves(trial: ReadTrial) -> Array:
    """Torques of 1 N m in each joint, as the cosine and as the sine of so many times its angle (ncolumn x npush x nstep
    x njoint).
    """
    middle = 0.5 * (trial.readings[:, 1:] + trial.readings[:, :-1])
    joints = np.eye(middle.shape[2])[:, None, None]
    waves = (wave(teeth * middle) for teeth in range(FEWEST, MOST + 1) for wave in (np.cos, np.sin))
    return np.concatenate([each * joints for each in waves])


def _beyond(trial: ReadTrial, most: Array) -> Array:
    """What each joint lacks (ncolumn x npush x nstep x njoint), in N m, where it is cut off at each of LEVELS of the
    `most` that was commanded (njoint).
    """
    joints = np.eye(len(most))[:, None, None]
    return np.concatenate([(np.clip(trial.torques, -at * most, at * most) - trial.torques) * joints for at in LEVELS])
