"""Angles and speeds of a push, as a polynomial of its noisy readings has them."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre

from metaid.estimation.trials import ReadTrial
from metaid.models import Array

DEGREE = 9  # of the polynomials that smooth the angles of a push


def smoothed(trial: ReadTrial) -> tuple[Array, Array]:
    """Angles, in rad, and speeds, in rad/s, of the joints at each step (npush x nstep x njoint), by a polynomial of
    each push; zeros after a fall.
    """
    timestep = trial.timestep * trial.substeps
    angles, speeds = np.zeros_like(trial.torques), np.zeros_like(trial.torques)
    for push, steps in enumerate(trial.steps.tolist()):
        if steps < 2:
            continue
        times = np.linspace(-1.0, 1.0, steps + 1)
        fitted = legendre.legfit(times, trial.readings[push, : steps + 1], min(DEGREE, steps // 2))
        angles[push, :steps] = legendre.legval(times[:-1], fitted).T
        speeds[push, :steps] = legendre.legval(times[:-1], legendre.legder(fitted)).T * (2.0 / (steps * timestep))
    return angles, speeds
