"""The bench as a body behind the example's socket: its drives, its sensors, its chance."""

from __future__ import annotations

import numpy as np

from soak.bench.arm import Arm, Array
from soak.bench.dynamics import Joints, advance, equations, room
from soak.bench.imperfections import Imperfections


class Bench:
    """An `arm` with imperfections, ticks of `timestep` s. A planar one is pushed by impulses at its tips; one in space
    is brought to a pose and speeds.
    """

    def __init__(self, arm: Arm, timestep: float, imperfections: Imperfections, is_planar: bool) -> None:
        n, has = len(arm.masses), imperfections
        tilted = np.array([np.sin(has.tilt) * -arm.gravity[2], 0.0, np.cos(has.tilt) * arm.gravity[2]])
        self.arm = arm._replace(rotors=arm.rotors + has.each("rotors", n), gravity=tilted)
        self.upright = arm
        self.timestep, self.has, self.needs = timestep, has, ("impulses",) if is_planar else ("pose", "speeds")
        of_each = {name: has.each(name, n) for name in ("viscous", "dry", "cogging", "cable")}
        self.joints = Joints(
            of_each["viscous"],
            of_each["dry"],
            has.stiction,
            has.stribeck,
            has.bending,
            of_each["cogging"],
            has.teeth,
            of_each["cable"],
            has.slack,
        )
        self.gains, limits = 1.0 + has.each("gains", n), has.each("torque_limit", n)
        self.limits = np.where(limits > 0.0, limits, np.inf)
        self.random = np.random.default_rng(has.seed)
        self.state, self.room = np.zeros((4, n)), room(n)
        self.shown, self.time = np.zeros(n), 0.0
        self.commands: list[tuple[float, Array]] = []

    def push(self, *asked: list[float]) -> None:
        n = len(self.arm.masses)
        pose, speeds = (np.zeros(n), self._struck(np.array(asked[0]))) if len(asked) == 1 else np.array(asked)
        scatter = 1.0 + self.has.start_speeds * self.random.standard_normal(n)
        angles = pose - self.has.encoder_offset + self.has.start_angles * self.random.standard_normal(n)
        self.state = np.array([angles, speeds * scatter, np.zeros(n), np.zeros(n)])
        self.shown, self.time = self.state[1].copy(), 0.0
        self.commands = [(-np.inf, np.zeros(n))]

    def _struck(self, impulses: Array) -> Array:
        """Joint speeds (n) after impulses (n) at the tips of upright links, in N s along x."""
        heights = np.cumsum(self.upright.places[:, 2])
        reach = np.maximum(heights[:, None] + self.upright.tips[:, 2:] - heights[None, :], 0.0)  # tip by joint
        reach *= np.tri(len(impulses))
        equations(self.arm, np.zeros(len(impulses)), np.zeros(len(impulses)), self.room)
        return np.asarray(np.linalg.solve(self.room.mass, reach.T @ impulses), dtype=np.float64)

    @property
    def told_time(self) -> float | None:
        """When the state is read, in s since the push, if the bench tells it."""
        return self.time if self.has.tells_time else None

    def states(self) -> tuple[list[float], list[float]]:
        noise = self.has.angle_noise * self.random.standard_normal(len(self.state[0]))
        angles = self.state[0] + self.has.encoder_offset + noise
        if self.has.encoder_step > 0.0:
            angles = self.has.encoder_step * np.round(angles / self.has.encoder_step)
        return angles.tolist(), (self.shown if self.has.speed_filter > 0.0 else self.state[1]).tolist()

    def advance(self, torque: list[float]) -> None:
        late = self.has.delay * max(1.0 + self.has.delay_jitter * float(self.random.standard_normal()), 0.0)
        wanted = np.clip(self.gains * np.array(torque), -self.limits, self.limits)
        if self.has.torque_noise > 0.0:
            wanted += self.has.torque_noise * self.random.standard_normal(len(wanted))
        self.commands = sorted([*self.commands, (self.time + late, wanted)], key=lambda command: command[0])
        length = self.timestep
        if self.has.tick_jitter > 0.0:
            length += float(np.clip(self.has.tick_jitter * self.random.standard_normal(), -0.5 * length, 0.5 * length))
        steps = max(round(self.has.rate * length), 1)
        times = np.array([moment - self.time for moment, _ in self.commands])
        drive = self.has.torque_lag, self.has.speed_filter, steps, length / steps
        acting = np.array([command for _, command in self.commands])
        advance(self.arm, self.joints, drive, self.state, self.shown, times, acting, self.room)
        self.time += length
        past = [command for command in self.commands if command[0] <= self.time]
        self.commands = [past[-1], *(command for command in self.commands if command[0] > self.time)]
