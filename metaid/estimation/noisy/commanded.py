"""What was commanded of a noisy plant: the law, on the readings that it acted on."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from metaid.models import Array, Lumps, compensation_basis

KINDS = ("gravity", "coriolis", "damping", "coulomb")


def commanded_torques(law: Lumps, angles: Array, speeds: Array, gravity: float) -> Array:
    """The joint torques (npush x nstep x njoint), in N m, that a law makes. None follows from the last reading.

    Args:
        law: that was sent.
        angles: of the joints that it acted on (npush x nstep + 1 x njoint), in rad.
        speeds: of the joints as the law took them to be (npush x nstep + 1 x njoint), in rad/s.
        gravity: in m/s².
    """
    leaning, turning = np.cumsum(angles[:, :-1], axis=-1), np.cumsum(speeds[:, :-1], axis=-1)
    lumps = law.vector_of(KINDS)
    force = compensation_basis(leaning, turning, gravity, KINDS) @ lumps  # Eqs. 5 and 12
    return np.ascontiguousarray(np.cumsum(force[..., ::-1], axis=-1)[..., ::-1])  # Eq. 6


def filtered_speeds(readings: Array, start_speeds: Array, weights: Array) -> Array:
    """Joint speeds (npush x nstep + 1 x njoint), in rad/s, as a law without a speed sensor takes them to be: the last
    angle `readings` (npush x nstep + 1 x njoint), in rad, times `weights` (nreading), in 1/s; and until there are so
    many, the `start_speeds` (npush x njoint) of the calibrated push.
    """
    count = len(weights)
    speeds = np.repeat(start_speeds[:, None], readings.shape[1], axis=1)
    if readings.shape[1] >= count:
        speeds[:, count - 1 :] = sliding_window_view(readings, count, axis=1) @ weights
    return speeds
