"""A chain under a servo along a trajectory, with the faults of a rig or as a model, compiled.

The torque is u = f(t) + K(t) (ω² (q_d − q) + 2 ω (q̇_d − q̇)) + G(t) (q_d − q), with f, K, G and the desired motion
known beforehand. The plant is the analytic chain, which agrees with MuJoCo to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.compiled import compiled
from metaid.compiled.analytic import AnalyticStep, advance_analytically
from metaid.compiled.law import LINK, turn_to_angles
from metaid.models import Array, Lumps

NO_FILTER = np.empty(0)


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


@dataclass(frozen=True)
class Sensors:
    """What comes between chain and servo: noise that is added to every angle read (nstep + 1 x njoint), in rad, and to
    every torque (nstep x njoint), in N m; the `weights` (nreading) that make a speed of angles, none where there is a
    sensor; by how many steps torques are late; the base's `tilt` in rad.
    """

    angle_noise: Array
    torque_noise: Array
    weights: Array
    delay: int = 0
    tilt: float = 0.0


@dataclass(frozen=True)
class Followed:
    """What is read of a chain under a servo, up to where it was lost: `angles` and `speeds` (nseen + 1 x njoint), and
    the `torques` that were commanded (nseen x njoint).
    """

    angles: Array
    speeds: Array
    torques: Array


def ideal(steps: int, njoint: int, delay: int = 0, tilt: float = 0.0) -> Sensors:
    """Sensors without noise."""
    return Sensors(np.zeros((steps + 1, njoint)), np.zeros((steps, njoint)), NO_FILTER, delay, tilt)


def follow(lumps: Lumps, gravity: float, timestep: float, servo: Servo, sensors: Sensors) -> Followed:
    """A chain along a trajectory that begins at rest where the servo's does, or with its speeds.

    Args:
        lumps: of the chain, with those of inertia, and damping where there is any.
        gravity: in m/s².
        timestep: in s, between two torques, too.
        servo: what drives it.
        sensors: what it sees of it.
    """
    steps, n = servo.angles.shape
    zero = np.zeros(n)
    weights = np.ascontiguousarray(gravity * lumps.gravity), np.ascontiguousarray(lumps.coriolis)
    resisting = np.ascontiguousarray(lumps.of("inertia")), np.ascontiguousarray(lumps.of("damping")), zero.copy()
    chain = AnalyticStep(
        servo.angles[0].copy(),
        servo.speeds[0].copy(),
        zero.copy(),
        *weights,
        *resisting,
        np.zeros((n, n)),
        zero,
        timestep,
    )
    angles, speeds, torques = np.empty((steps + 1, n)), np.empty((steps + 1, n)), np.empty((steps, n))
    driven = servo.angles, servo.speeds, servo.forward, servo.gains, servo.bandwidth, servo.stiffness
    seen = sensors.angle_noise, sensors.torque_noise, sensors.weights, sensors.delay, sensors.tilt
    done = _follow(chain, np.zeros(n, LINK), driven, seen, angles, speeds, torques)
    return Followed(angles[: done + 1], speeds[: done + 1], torques[:done])


LOST = 10.0  # rad off the trajectory


@compiled
def _follow(chain, links, driven, seen, angles, speeds, torques):  # type: ignore[no-untyped-def]
    """Fills `angles`, `speeds` (nstep + 1 x njoint) and `torques` (nstep x njoint); returns the steps before it was
    lost.
    """
    wanted, wanted_speeds, forward, gains, bandwidth, stiffness = driven
    angle_noise, torque_noise, weights, delay, tilt = seen
    count, (steps, n) = weights.shape[0], wanted.shape
    for step in range(steps + 1):
        for i in range(n):
            angles[step, i] = chain.qpos[i] + angle_noise[step, i]
            if count == 0:
                speeds[step, i] = chain.qvel[i]
            elif step + 1 >= count:
                speeds[step, i] = 0.0
                for k in range(count):
                    speeds[step, i] += weights[k] * angles[step + 1 - count + k, i]
            else:
                speeds[step, i] = wanted_speeds[0, i]
        if step == steps:
            break
        for i in range(n):
            torques[step, i] = forward[step, i]
            for j in range(n):
                error = wanted[step, j] - angles[step, j]
                if not abs(error) <= LOST:
                    return step
                rate = wanted_speeds[step, j] - speeds[step, j]
                torques[step, i] += gains[step, i, j] * bandwidth * (bandwidth * error + 2.0 * rate)
                torques[step, i] += stiffness[step, i, j] * error
        angle, speed = tilt, 0.0
        for i in range(n):
            chain.torque[i] = torque_noise[step, i] + (torques[step - delay, i] if step >= delay else 0.0)
            angle += chain.qpos[i]
            speed += chain.qvel[i]
            links[i].angle = angle
            links[i].speed = speed
        turn_to_angles(links, 0.0)
        advance_analytically(chain, links)
    return steps
