"""A simulated plant behind its faults, a chain or an arm: a controller sees what the sensors read, and the plant gets
what the drives deliver.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from metaid.models import Array
from metaid.plant.arm_plant import ArmPlant
from metaid.plant.faults import Noise, draw, of_each, readings, slope_weights
from metaid.plant.mujoco_plant import MujocoPlant
from metaid.plant.start import ArmStart, Start


class FaultyPlant:
    """A plant behind its faults; a step is a control step. `begin` gives it the noise of an episode."""

    def __init__(self, plant: MujocoPlant | ArmPlant) -> None:
        self.inner: Any = plant
        self.faults = plant.settings.faults
        self.name, self.njoint = plant.name, plant.njoint
        self.timestep = self.faults.control_period(plant.timestep)
        n = self.njoint
        self._limits, self._gains = of_each(self.faults.torque_limit, n), of_each(self.faults.torque_gain, n)
        self._offsets = of_each(self.faults.encoder_offset, n)
        self._weights = slope_weights(self.timestep)

    def begin(self, noise: Noise) -> None:
        """The next push is the first of an episode with this `noise`."""
        self._noise = noise
        self._push = -1

    def push(self, start: Start | ArmStart) -> None:
        self._push += 1
        self._step = 0
        self._commands = deque([np.zeros(self.njoint)] * self.faults.delay)
        self._angles: list[Array] = []
        # The speeds of such a push as calibrated, for there are too few angles for a slope at first.
        self._expected = self.inner.start_speeds(start)
        self.inner.push(start.struck(self._noise.impulses[self._push]))
        self._read()

    def _read(self) -> None:
        angles, speeds = self.inner.states()
        seen = angles + self._offsets + self._noise.angles[self._push, self._step]
        self._angles.append(readings(seen, self.faults.encoder_step))
        count = len(self._weights)
        if self.faults.speed_sensor:
            self._speeds = speeds + self._noise.speeds[self._push, self._step]
        elif len(self._angles) >= count:
            self._speeds = self._weights @ np.array(self._angles[-count:])
        else:
            self._speeds = self._expected

    def states(self) -> tuple[Array, Array]:
        return self._angles[-1], self._speeds

    def apply_torque(self, torque: Array) -> None:
        self._commands.append(torque)

    def step(self) -> None:
        delivered = self._gains * np.clip(self._commands.popleft(), -self._limits, self._limits)
        self.inner.apply_torque(delivered + self._noise.torques[self._push, self._step])
        for _ in range(self.faults.control_every):
            self.inner.step()
        self._step += 1
        self._read()

    def stop(self) -> None:
        self.inner.stop()

    def close(self) -> None:
        self.inner.close()

    @property
    def gravity(self) -> float:
        """Of a chain, in m/s²."""
        return float(self.inner.gravity)

    def rest(self, count: int, seed: int) -> Array:
        """Angle readings (count x njoint), in rad, of the plant held upright."""
        noise = draw(self.faults, np.random.default_rng([seed, count]), 1, count - 1, self.njoint)
        return readings(noise.angles[0], self.faults.encoder_step)
