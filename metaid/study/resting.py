"""What the sensors of a rig at rest tell of their noise."""

from __future__ import annotations

import numpy as np

from metaid.models import Array

REPEATS = 4  # of each push in a calibration; a power of two, so that the mean of equal speeds is one of them
FEWEST_READINGS, MOST_READINGS = 20, 200  # at rest
DRIFT = 4  # coefficients of what a rig at rest may drift by; what is left is noise


def noise_at_rest(rest: Array) -> Array:
    """The standard deviation of angles in rad and of speeds in rad/s (2 x njoint) about a slow drift, from readings at
    rest (nreading x 2 x njoint).
    """
    drifts = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, len(rest)), DRIFT))[0]
    flat = rest.reshape(len(rest), -1)
    left = flat - drifts @ (drifts.T @ flat)
    # A reading that never changes has no noise; what the projection leaves of it is rounding.
    left[:, (flat == flat[0]).all(axis=0)] = 0.0
    deviations: Array = np.sqrt((left**2).sum(axis=0) / (len(rest) - DRIFT))
    return deviations.reshape(rest.shape[1:])
