"""Exciting trajectories, as the literature has them: Fourier series, of which the best conditioned of many is taken.

Each joint moves by a sum of sines and cosines of a common period, from rest to rest, straight at both ends. Of many
random ones that keep within the limits those are taken whose regressor of the nominal model has the least condition
number, columns in units of the nominal parameters: the first for itself, each other one together with those before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.by_torque import inverse_dynamics_regressor
from metaid.models import Array, Chain

PERIOD, HARMONICS = 5.0, 8  # s
SWING, SPEED = 1.5, 6.0  # limits of every joint, in rad and rad/s
DRAWN, DIFFERENT = 80, 3  # trajectories drawn for each one that is taken, and how many are taken
SAMPLES = 100  # of a trajectory, for its condition number


@dataclass(frozen=True)
class Trajectory:
    """Joint `angles` in rad, `speeds` in rad/s and `accelerations` in rad/s² over time, each (nstep x njoint)."""

    angles: Array
    speeds: Array
    accelerations: Array


def exciting(
    nominal: Chain, gravity: float, timestep: float, seconds: float, seed: int, share: float = 1.0
) -> Trajectory:
    """Trajectories one after the other, each different one as often as there is time.

    Args:
        nominal: the chain that they are chosen for.
        gravity: in m/s².
        timestep: in s.
        seconds: of the whole motion; rounded to whole periods.
        seed: of the random draws.
        share: of the limits.
    """
    count = max(round(seconds / PERIOD), 1)
    random = np.random.default_rng([seed, nominal.nlink])
    scale = np.append(nominal.lumps.vector, nominal.inertia_lumps)
    chosen: list[Array] = []
    rows = np.empty((0, len(scale)))
    for _ in range(min(count, DIFFERENT)):
        drawn = [share * _draw(random, nominal.nlink) for _ in range(DRAWN)]
        stacked = [np.concatenate([rows, _rows(series, gravity) * scale]) for series in drawn]
        best = int(np.argmin([np.linalg.cond(each.T @ each) for each in stacked]))
        chosen.append(drawn[best])
        rows = stacked[best]
    times = np.asarray(timestep * np.arange(round(PERIOD / timestep)), dtype=np.float64)
    moved = [_motion(series, times) for series in chosen]
    parts = [moved[number % len(moved)] for number in range(count)]
    return Trajectory(*(np.concatenate([part[kind] for part in parts]) for kind in range(3)))


def _draw(random: np.random.Generator, njoint: int) -> Array:
    """Coefficients (2 x njoint x nharmonic) of sines and cosines, from rest to rest and within the limits."""
    rates = _rates()
    drawn: Array = random.standard_normal((2, njoint, HARMONICS)) / rates
    sines, cosines = drawn
    sines -= np.outer(sines @ rates, rates) / (rates @ rates)  # no speed at the ends
    cosines -= np.outer(cosines @ rates**2, rates**2) / (rates**2 @ rates**2)  # and no acceleration
    angles, speeds, _ = _motion(drawn, _times(4 * SAMPLES))
    by = np.maximum(np.abs(angles).max(axis=0) / SWING, np.abs(speeds).max(axis=0) / SPEED)
    return np.asarray(drawn / by[:, None])


def _motion(series: Array, times: Array) -> tuple[Array, Array, Array]:
    """Angles, speeds and accelerations (ntime x njoint) of `series` (2 x njoint x nharmonic)."""
    sines, cosines = series
    rates = _rates()
    sine, cosine = np.sin(np.outer(times, rates)), np.cos(np.outer(times, rates))
    angles = sine @ sines.T + (cosine - 1.0) @ cosines.T
    speeds = cosine @ (sines * rates).T - sine @ (cosines * rates).T
    accelerations = -sine @ (sines * rates**2).T - cosine @ (cosines * rates**2).T
    return angles, speeds, accelerations


def _times(samples: int) -> Array:
    """As many `samples` of a period (nsample), in s."""
    return np.asarray(np.linspace(0.0, PERIOD, samples), dtype=np.float64)


def _rates() -> Array:
    """Of the harmonics (nharmonic), in rad/s."""
    return np.asarray(2.0 * np.pi / PERIOD * np.arange(1, HARMONICS + 1))


def _rows(series: Array, gravity: float) -> Array:
    """The regressor along a trajectory (nsample njoint x nparameter)."""
    motion = _motion(series, _times(SAMPLES))
    regressor = inverse_dynamics_regressor(*motion, gravity)
    return regressor.reshape(-1, regressor.shape[2])
