"""A servo along a trajectory, and the model of a chain under it, compiled.

The torque is u = f(t) + K(t) (ω² (q_d − q) + 2 ω (q̇_d − q̇)) + G(t) (q_d − q), with f, K, G and the desired motion
known beforehand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.rivals.chain_step import AnalyticStep, flow_analytically
from metaid.compiled import compiled
from metaid.compiled.law import LINK
from metaid.models import Array, Lumps

NO_FILTER = np.empty(0)
LOST = 10.0  # rad off the trajectory
Seen = tuple[Array, Array, int, float]
Driven = tuple[Array, Array, Array, Array, float, Array]


@dataclass(frozen=True)
class Servo:
    """Joint `angles` (rad) and `speeds` (rad/s) to follow, (nstep x njoint), the torques `forward` (nstep x njoint), in
    N m, that are sent whatever happens, the matrix `gains` (nstep x njoint x njoint) in kg m² and the `bandwidth` in
    rad/s of the feedback, and a further `stiffness` (nstep x njoint x njoint) in N m/rad.
    """

    angles: Array
    speeds: Array
    forward: Array
    gains: Array
    bandwidth: float
    stiffness: Array

    @property
    def driven(self) -> Driven:
        """As the compiled loops take it."""
        return self.angles, self.speeds, self.forward, self.gains, self.bandwidth, self.stiffness

    def first(self, steps: int) -> Servo:
        """Its first `steps`."""
        return self._of(lambda each: each[:steps])

    def held(self, times: int) -> Servo:
        """The same whose feedback is sent so many times a step, what is wanted held for it."""
        return self._of(lambda each: np.repeat(each, times, axis=0))

    def _of(self, change: Callable[[Array], Array]) -> Servo:
        moved = change(self.angles), change(self.speeds), change(self.forward), change(self.gains)
        return Servo(*moved, self.bandwidth, change(self.stiffness))


@dataclass(frozen=True)
class Sensors:
    """What comes between rig and servo: by how much each angle is read too large (njoint), in rad; the `weights`
    (nreading) that make a speed of angles, none where there is a sensor; by how many steps torques are late; and the
    base's `tilt` in rad.
    """

    offset: Array
    weights: Array
    delay: int = 0
    tilt: float = 0.0

    def tilted(self, tilt: float) -> Sensors:
        """The same on a base that is turned by so many rad."""
        return replace(self, tilt=tilt)

    @property
    def seen(self) -> Seen:
        """As the compiled loops take them."""
        return self.offset, self.weights, self.delay, self.tilt


@dataclass(frozen=True)
class Followed:
    """What is read of a rig under a servo, up to where it was lost: `angles` and `speeds` (nseen + 1 x njoint), and
    the `torques` that were commanded (nseen x njoint).
    """

    angles: Array
    speeds: Array
    torques: Array


def follow(lumps: Lumps, gravity: float, timestep: float, servo: Servo, sensors: Sensors) -> Followed:
    """The model of a chain along a trajectory that begins, as it is read, where the servo's does, with its speeds.

    Args:
        lumps: of the chain, with those of inertia, and damping where there is any.
        gravity: in m/s².
        timestep: in s, between two torques.
        servo: what drives it.
        sensors: what it sees of it.
    """
    n = servo.angles.shape[1]
    weights = np.ascontiguousarray(gravity * lumps.gravity), np.ascontiguousarray(lumps.coriolis)
    resisting = np.ascontiguousarray(lumps.of("inertia")), np.ascontiguousarray(lumps.of("damping"))
    begun = servo.angles[0] - sensors.offset, servo.speeds[0].copy(), np.zeros(n)
    chain = AnalyticStep(*begun, *weights, *resisting, np.zeros((n, n)), np.zeros(n), timestep)
    space = np.zeros(n, LINK), np.zeros((4, n))
    return recorded(servo, lambda *read: _follow(chain, *space, servo.driven, sensors.seen, *read))


def recorded(servo: Servo, run: Callable[[Array, Array, Array], int]) -> Followed:
    """What a loop reads while it `run`s: it fills angles, speeds (nstep + 1 x njoint) and torques (nstep x njoint), and
    returns the steps before the rig was lost.
    """
    steps, n = servo.angles.shape
    angles, speeds, torques = np.empty((steps + 1, n)), np.empty((steps + 1, n)), np.empty((steps, n))
    done = run(angles, speeds, torques)
    return Followed(angles[: done + 1], speeds[: done + 1], torques[:done])


@compiled
def read_and_command(step, qpos, qvel, driven, offset, weights, angles, speeds, torques):  # type: ignore[no-untyped-def]
    """Fills in what is read at a `step`, and what is sent then where it is not the last; whether the rig is still near
    its trajectory.
    """
    wanted, wanted_speeds, forward, gains, bandwidth, stiffness = driven
    count, (steps, n) = weights.shape[0], wanted.shape
    for i in range(n):
        angles[step, i] = qpos[i] + offset[i]
        if count == 0:
            speeds[step, i] = qvel[i]
        elif step + 1 >= count:
            speeds[step, i] = 0.0
            for k in range(count):
                speeds[step, i] += weights[k] * angles[step + 1 - count + k, i]
        else:
            speeds[step, i] = wanted_speeds[0, i]
    if step == steps:
        return True
    for i in range(n):
        torques[step, i] = forward[step, i]
        for j in range(n):
            error = wanted[step, j] - angles[step, j]
            if not abs(error) <= LOST:
                return False
            rate = wanted_speeds[step, j] - speeds[step, j]
            torques[step, i] += gains[step, i, j] * bandwidth * (bandwidth * error + 2.0 * rate)
            torques[step, i] += stiffness[step, i, j] * error
    return True


@compiled
def _follow(chain, links, stages, driven, seen, angles, speeds, torques):  # type: ignore[no-untyped-def]
    """Fills `angles`, `speeds` (nstep + 1 x njoint) and `torques` (nstep x njoint); returns the steps before it was
    lost.
    """
    offset, weights, delay, tilt = seen
    steps, n = torques.shape
    for step in range(steps + 1):
        if not read_and_command(step, chain.qpos, chain.qvel, driven, offset, weights, angles, speeds, torques):
            return step
        if step == steps:
            break
        for i in range(n):
            chain.torque[i] = torques[step - delay, i] if step >= delay else 0.0
        flow_analytically(chain, links, tilt, stages)
    return steps
