"""Faults whose derivatives say nothing from none on, so some guesses are tried by one linear fit each: how many times a
turn cogging repeats, and at what torque motors cut off.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from metaid.estimation.descent import Place, triangle
from metaid.estimation.noisy.innovations import Innovations
from metaid.estimation.noisy.unmodelled import by_chance, least_squares
from metaid.estimation.trials import ReadTrial
from metaid.models import Array

FEWEST, MOST = 3, 40  # times a turn; of fewer gravity, a tilt and a spring have as much
# Of the largest torque that was commanded: where it may be cut off. A joint that falls is commanded ever more.
LEVELS = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.15, 0.1, 0.07, 0.05, 0.03, 0.02)
HELD = 0.5  # of what is beyond a limit: a joint that lacks less of it has none
ROUNDS = 4  # through the joints: what is beyond the limit of one may look like what is beyond another's

# The sum of squares that torques of some numbers leave, but for what no unknown changes, and their sizes.
LeftBy = Callable[[Iterable[int]], tuple[float, Array]]


def teeth_shown(led: Innovations, point: Array) -> int:
    """How many times a turn the torque repeats, in each joint with an amplitude and a phase of its own, that leaves
    least of the innovations of all trials, at a `point` with what concerns a push alone, beside unknowns that may
    change with it; 0 where the twin cannot follow.  Eq. 42.
    """
    left_by, each = _scan(led, point, [_waves(trial) for trial in led.trials]), 2 * led.unknowns.njoint
    if left_by is None:
        return 0
    left = [left_by(range(number * each, (number + 1) * each))[0] for number in range(MOST - FEWEST + 1)]
    return FEWEST + left.index(min(left))


def limits_shown(led: Innovations, point: Array) -> Array | None:
    """What the motors give at most (njoint), in N m: of each joint the level that leaves least of the innovations
    beside those of the others, found one joint after the other from none on, and from the level that leaves least as
    that of all; where a joint has none, the largest torque that was commanded. None where all have none, or the twin
    cannot follow.
    """
    n = led.unknowns.njoint
    most = np.max([np.abs(trial.torques).max(axis=(0, 1)) for trial in led.trials], axis=0)
    left_by = _scan(led, point, [_beyond(trial, most) for trial in led.trials])
    if left_by is None:
        return None
    alike = [dict.fromkeys(range(n), level) for level in range(len(LEVELS))]
    begun: list[dict[int, int]] = [{}, min(alike, key=lambda levels: left_by(_numbers(levels, n))[0])]
    for levels in begun:
        for _ in range(ROUNDS):
            before = dict(levels)
            for joint in range(n):
                _set_level(left_by, levels, joint, n)
            if levels == before:
                break
    levels = min(begun, key=lambda levels: left_by(_numbers(levels, n))[0])
    if not levels:
        return None
    return np.array([most[joint] * (LEVELS[levels[joint]] if joint in levels else 1.0) for joint in range(n)])


def _numbers(levels: dict[int, int], n: int) -> list[int]:
    """Of the torques that lack beyond these `levels` of `n` joints."""
    return [level * n + joint for joint, level in levels.items()]


def _set_level(left_by: LeftBy, levels: dict[int, int], joint: int, n: int) -> None:
    """Changes the level of a `joint` to the one that leaves least beside the `levels` of the others; to none where that
    leaves as much but for chance, or lacks less of what is beyond it.
    """
    levels.pop(joint, None)
    others = _numbers(levels, n)
    without = left_by(others)[0]
    tried = [left_by([*others, level * n + joint]) for level in range(len(LEVELS))]
    best = min(range(len(tried)), key=lambda level: tried[level][0])
    left, sizes = tried[best]
    if sizes[-1] > HELD and without - left > by_chance(1):
        levels[joint] = best


def _scan(led: Innovations, point: Array, columns: Sequence[Array]) -> LeftBy | None:
    """What further torques leave, the `columns` (ncolumn x npush x nstep x njoint of each trial), beside unknowns whose
    priors are known; None where the twin cannot follow.
    """
    residuals = led.residuals_with(point, columns)
    if residuals is None:
        return None
    count, torques = len(led.spreads), np.zeros(len(columns[0]))
    place = Place(np.append(point[:count], torques), residuals, residuals.cost)
    # All trials are one triangular system, slopes @ step - target, but for what no step changes.
    slopes, target = triangle(place, np.append(led.spreads, torques + np.inf))

    def left_by(numbers: Iterable[int]) -> tuple[float, Array]:
        chosen = [*range(count), *(count + number for number in numbers)]
        left, step, _ = least_squares(slopes[:, chosen], -target)
        return left, step[count:]

    return left_by


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
