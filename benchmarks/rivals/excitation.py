"""Exciting trajectories, as the literature has them: Fourier series, of which the best conditioned of many is taken.

Each joint moves by a sum of sines and cosines of a common period, from rest to rest, where it is at rest at both ends.
Of many random ones that keep within the limits those are taken whose regressor of the nominal model has the least
condition number, columns in units of the parameters: the first for itself, each other one together with those before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from metaid.excitation import Series, Trajectory, rest_to_rest
from metaid.models import Array

PERIOD, HARMONICS = 5.0, 8  # s
DRAWN, DIFFERENT = 80, 3  # trajectories drawn for each one that is taken, and how many are taken
SAMPLES = 100  # of a trajectory, for its condition number


@dataclass(frozen=True)
class Limits:
    """Of a trajectory: where joints `rest` (njoint), by how much they `swing` from there at most (njoint), in rad, and
    how fast they are at most, in rad/s.
    """

    rest: Array
    swing: Array
    speed: float


def exciting(
    rows: Callable[[Array, Array, Array], Array],
    limits: Limits,
    timestep: float,
    seconds: float,
    seed: int,
    share: float = 1.0,
) -> Trajectory:
    """Trajectories one after the other, each different one as often as there is time.

    Args:
        rows: of angles, speeds and accelerations (nsample x njoint each) the regressor (nsample x njoint x nparameter),
            of parameters in their units.
        limits: of the motion.
        timestep: in s.
        seconds: of the whole motion; rounded to whole periods.
        seed: of the random draws.
        share: of the limits.
    """
    n = len(limits.rest)
    count = max(round(seconds / PERIOD), 1)
    random = np.random.default_rng([seed, n])
    chosen: list[Array] = []
    square: Array | None = None
    for _ in range(min(count, DIFFERENT)):
        drawn = [share * _draw(random, limits) for _ in range(DRAWN)]
        squares = [_square(rows, series, limits) + (0.0 if square is None else square) for series in drawn]
        best = int(np.argmin([np.linalg.cond(each) for each in squares]))
        chosen.append(drawn[best])
        square = squares[best]
    times = np.asarray(timestep * np.arange(round(PERIOD / timestep)), dtype=np.float64)
    moved = [_motion(series, times, limits) for series in chosen]
    parts = [moved[number % len(moved)] for number in range(count)]
    return Trajectory(*(np.concatenate([part[kind] for part in parts]) for kind in range(3)))


def _draw(random: np.random.Generator, limits: Limits) -> Array:
    """Coefficients (2 x njoint x nharmonic) of sines and cosines, from rest to rest and within the limits."""
    rates = _rates()
    sines, cosines = random.standard_normal((2, len(limits.rest), HARMONICS)) / rates
    drawn: Array = np.stack(rest_to_rest(sines, cosines, rates))
    angles, speeds, _ = _motion(drawn, _times(4 * SAMPLES), limits)
    moved = np.abs(angles - limits.rest).max(axis=0)
    by = np.maximum(moved / limits.swing, np.abs(speeds).max(axis=0) / limits.speed)
    return np.asarray(drawn / by[:, None])


def _motion(series: Array, times: Array, limits: Limits) -> tuple[Array, Array, Array]:
    """Angles, speeds and accelerations (ntime x njoint) of `series` (2 x njoint x nharmonic)."""
    motion = Series(limits.rest, series[0], series[1], PERIOD).at(times)
    return motion.angles, motion.speeds, motion.accelerations


def _times(samples: int) -> Array:
    """As many `samples` of a period (nsample), in s."""
    return np.asarray(np.linspace(0.0, PERIOD, samples), dtype=np.float64)


def _rates() -> Array:
    """Of the harmonics (nharmonic), in rad/s."""
    return np.asarray(2.0 * np.pi / PERIOD * np.arange(1, HARMONICS + 1))


def _square(rows: Callable[[Array, Array, Array], Array], series: Array, limits: Limits) -> Array:
    """Xᵀ X of the regressor X along a trajectory (nparameter x nparameter)."""
    regressor = rows(*_motion(series, _times(SAMPLES), limits))
    flat = regressor.reshape(-1, regressor.shape[2])
    return np.asarray(flat.T @ flat)
