"""What one trial of a noisy plant showed, and what it was sent."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array


@dataclass(frozen=True)
class ReadTrial:
    """What the sensors of a noisy plant read in one trial, and what it was sent.

    Attributes:
        timestep: in which the plant moves, in s.
        readings: joint angles (npush x nstep + 1 x njoint), in rad or m, the one right after the push first.
        torques: as they were commanded (npush x nstep x njoint), in N m.
        steps: how many steps (npush) of each push were seen before a fall.
        start_speeds: joint speeds (npush x njoint), in rad/s, that such pushes gave in a calibration.
        start_spread: what pushes differ by, a root of the covariance of the start speeds (npush x njoint x njoint), in
            rad/s: any L with covariance L Lᵀ. Of an arm perhaps that of coordinates and speeds (npush x 2 njoint x
            2 njoint). None where they are all alike.
        noise: standard deviation of a reading of each joint (njoint), in rad, from the plant at rest.
        substeps: how many timesteps there are between two readings, and between two torques.
        poses: joint coordinates (npush x njoint), in rad or m, at which the pushes begin; None for a chain that stands
            upright.
    """

    timestep: float
    readings: Array
    torques: Array
    steps: NDArray[np.int64]
    start_speeds: Array
    start_spread: Array | None
    noise: Array
    substeps: int = 1
    poses: Array | None = None

    @cached_property
    def forces(self) -> Array:
        """The torques as generalised forces in absolute angles (npush x nstep x njoint), in N m."""
        return np.ascontiguousarray(-np.diff(self.torques, axis=-1, append=0.0))

    @property
    def extras(self) -> int:
        """How many start speeds, and coordinates, are unknown."""
        return 0 if self.start_spread is None else len(self.start_spread) * self.start_spread.shape[-1]


class Driven(NamedTuple):
    """A trial, as far as a twin is to show it.

    Attributes:
        trial: with the torques that acted.
        starts: joint coordinates and speeds (npush x 2 x njoint) right after each push.
        steps: how many steps (npush) of each push to follow.
        basis: the polynomials (npush x nstep + 1 x ncoefficient) that each push is seen in.
    """

    trial: ReadTrial
    starts: Array
    steps: NDArray[np.int64]
    basis: Array


class Coefficients(NamedTuple):
    """Of the twin's angles in polynomials: `values` (npush x njoint x ncoefficient), in rad or m, and their `slopes`
    (npush x njoint x ncoefficient x nunknown, and more by what is unknown of the starts).
    """

    values: Array
    slopes: Array
