"""How a noisy plant is controlled and read, and what that makes of the readings of a trial."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from metaid.episode import SensorReadings
from metaid.estimation.faults import late
from metaid.estimation.trials import BUILT_UP, ReadTrial
from metaid.models import Array

# Of a step: more than 1/√12, which it would be if steps came at random. Those of a joint that coasts come in rhythm.
ENCODER_NOISE = 1.0 / 3.0


@dataclass(frozen=True)
class Loop:
    """How a plant is controlled and read, as far as its user states it.

    Attributes:
        timestep: in which the twin moves, in s.
        noise: standard deviation of a reading of each joint (njoint), in rad or m, from the plant at rest.
        speed_weights: of the last angle readings (nreading), in 1/s, for the speed where there is no sensor of it.
        start_spread: what pushes differ by, as `ReadTrial` has it (npush x njoint x njoint), in rad/s, or None.
        substeps: how many timesteps a torque holds.
        delay: how many torques late it is.
        lead: seconds by which the law looks ahead.
        torque_limits: what the motors are said to give at most (njoint), in N m.
        has_unknown_encoders: whether the resolution of the encoders is to be seen in the readings; else it is in the
            `noise`.
        is_continuous: whether the plant moves continuously, as a real one does, and not in steps, as a simulated one.
    """

    timestep: float
    noise: Array
    speed_weights: Array
    start_spread: Array | None = None
    substeps: int = 1
    delay: int = 0
    lead: float = 0.0
    torque_limits: Array | float = np.inf
    has_unknown_encoders: bool = False
    is_continuous: bool = False

    @property
    def declared_delay(self) -> float:
        """By which torques are known to be late, in s."""
        return self.delay * self.timestep * self.substeps

    def trial(self, read: SensorReadings, starts: Array, law: Callable[[Array, Array], Array]) -> ReadTrial:
        """A trial by what its sensors `read`, with joint coordinates and speeds as such pushes give (npush x 2 x
        njoint), and the torques (npush x nstep x njoint), in N m, that its `law` makes of coordinates and speeds (npush
        x nstep + 1 x njoint each).
        """
        speeds = read.speeds
        if speeds is None:
            speeds = filtered_speeds(read.angles, starts[:, 1], self.speed_weights)
        torques, _ = late(law(read.angles + self.lead * speeds, speeds), self.delay)
        torques = np.ascontiguousarray(np.clip(torques, -self.torque_limits, self.torque_limits), dtype=np.float64)
        # At rest a reading shows the steps of its encoder as far as its other noise moves it across them.
        of_encoders = read.encoder_steps * ENCODER_NOISE
        noise = np.maximum(self.noise, of_encoders) if self.has_unknown_encoders else self.noise
        seen, pushes = (self.timestep, read.angles, torques, read.steps), (starts, self._spread(len(starts)))
        return ReadTrial(*seen, *pushes, noise, self.substeps, self.is_continuous, read.times)

    def _spread(self, npush: int) -> Array | None:
        """What pushes differ by, as `ReadTrial` has it."""
        if not self.is_continuous:
            return self.start_spread
        n = len(self.noise)
        known = np.zeros((npush, 0, 0)) if self.start_spread is None else self.start_spread
        own = known.shape[-1]
        every = np.zeros((npush, own + n, own + n))
        every[:, :own, :own] = known
        every[:, own:, own:] = BUILT_UP * np.eye(n)
        return every


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
