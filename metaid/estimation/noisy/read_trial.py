"""What one trial of a noisy plant showed, and what it was sent."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array


@dataclass(frozen=True)
class ReadTrial:
    """What the sensors of a noisy plant read in one trial, and what it was sent.

    Attributes:
        timestep: in which the plant moves, in s.
        readings: joint angles (npush x nstep + 1 x njoint), in rad, the one right after the push first.
        torques: as they were commanded (npush x nstep x njoint), in N m.
        steps: how many steps (npush) of each push were seen before a fall.
        start_speeds: joint speeds (npush x njoint), in rad/s, that such pushes gave in a calibration.
        start_spread: what pushes differ by, a root of the covariance of the start speeds (npush x njoint x njoint), in
            rad/s: any L with covariance L Lᵀ. None where they are all alike.
        noise: standard deviation of a reading of each joint (njoint), in rad, from the plant at rest.
        substeps: how many timesteps there are between two readings, and between two torques.
    """

    timestep: float
    readings: Array
    torques: Array
    steps: NDArray[np.int64]
    start_speeds: Array
    start_spread: Array | None
    noise: Array
    substeps: int = 1

    @cached_property
    def forces(self) -> Array:
        """The torques as generalised forces in absolute angles (npush x nstep x njoint), in N m."""
        return np.ascontiguousarray(-np.diff(self.torques, axis=-1, append=0.0))

    @property
    def extras(self) -> int:
        """How many start speeds are unknown."""
        return 0 if self.start_spread is None else self.start_speeds.size
