"""Accelerations from noisy angles: a curve through the whole of each push, in place of differences from step to step.

A chain that is struck at rest upright and compensated with wrong lumps accelerates in odd powers of time alone, for
every term of Eq. 4 is odd in the angles. So the curve is c₀ + c₁ t + c₃ t³. It has one number of acceleration a joint.
Differences of n readings have n, each with all of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from metaid.models import Array

POWERS = (0, 1, 3)


@dataclass(frozen=True)
class NoiseFloor:
    """What an episode's readings would show of a plant at rest: the `energy` ∫ q̈² dt of all pushes and joints, in
    rad²/s³; the `frequency` that it looks like, in Hz; and the root of the standard deviation of its square, `spread`,
    in Hz.
    """

    energy: float
    frequency: float
    spread: float


SILENT = NoiseFloor(0.0, 0.0, 0.0)


@cache
def _curve(count: int) -> Array:
    """The matrix (3 x count) that takes `count` readings, evenly spaced over unit time, to c₀, c₁ and c₃."""
    times = np.linspace(0.0, 1.0, count)
    return np.asarray(np.linalg.pinv(np.stack([times**power for power in POWERS], axis=1)))


def smooth_energies(angles: Array, timestep: float) -> tuple[Array, Array]:
    """∫ q̇² dt in rad²/s and ∫ q̈² dt in rad²/s³ of the curves that fit joint `angles` best: (npush x nsteps + 1 x
    njoint), in rad → (npush x njoint) each.  Eq. 47.
    """
    horizon = timestep * (angles.shape[1] - 1)
    _, linear, cubic = np.einsum("cs,psj->cpj", _curve(angles.shape[1]), angles)
    speed_energy = (linear**2 + 2.0 * linear * cubic + 1.8 * cubic**2) / horizon
    return speed_energy, 12.0 * cubic**2 / horizon**3


def smoothed_hz(angles: Array, timestep: float, noise_floor: float) -> float:
    """√((∫ q̈² dt − `noise_floor`) / ∫ q̇² dt) / 2π, sums over joints and pushes, in Hz; negative where the difference
    is, and zero if nothing moves.  Eq. 48.

    Joint `angles` (npush x nsteps + 1 x njoint) in rad; `noise_floor` in rad²/s³.
    """
    speed_energy, acceleration_energy = smooth_energies(angles, timestep)
    moving = float(speed_energy.sum())
    excess = (acceleration_energy.sum() - noise_floor) / moving if moving > 0.0 else 0.0
    return float(np.sign(excess) * np.sqrt(abs(excess))) / (2.0 * np.pi)


def noise_floor(rest: Array, timestep: float, start_speeds: Array) -> NoiseFloor:
    """What an episode would show of a plant that does not move, from readings at rest (nwindow x nsteps + 1 x njoint),
    in rad, of as many steps as a push has; for joints pushed to `start_speeds` (npush x njoint), in rad/s.
    """
    _, energy = smooth_energies(rest, timestep)
    npush, horizon = len(start_speeds), timestep * (rest.shape[1] - 1)
    window = energy.sum(axis=1)
    moving = float((start_speeds**2).sum()) * horizon * (2.0 * np.pi) ** 2
    total, spread = npush * float(window.mean()), np.sqrt(npush) * float(window.std())
    return NoiseFloor(total, np.sqrt(total / moving), np.sqrt(spread / moving))
