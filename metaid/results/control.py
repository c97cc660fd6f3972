"""Computed-torque control along a joint trajectory: what an identified model is good for.

The feedforward is the candidate's. The feedback is the same whatever the candidate. So candidates are compared by their
parameters alone.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from metaid.models import Array, Trajectory
from metaid.plant import SimulatedPlant

AMPLITUDE = 0.5  # rad, of the mean joint's sinusoid
PERIODS = 6.0, 12.0  # fastest and slowest of the joints' sinusoids, in natural times
BANDWIDTH = 3.0  # of the feedback, in rad per natural time
LOST = np.pi  # rad or m off the trajectory: out of control


class Controlled(Protocol):
    """What moves a plant, at one state."""

    def inverse_dynamics(self, angles: Array, speeds: Array, accelerations: Array, /) -> Array:
        """The torque (njoint) that gives the joints these accelerations (njoint), at these coordinates and speeds."""

    def mass_matrix(self, angles: Array, /) -> Array:
        """The mass matrix (njoint x njoint)."""


def smooth_sinusoids(
    njoint: int,
    natural_time: float,
    timestep: float,
    amplitude: float | Array = AMPLITUDE,
    periods: tuple[float, float] = PERIODS,
) -> Trajectory:
    """A joint trajectory from rest upright, two of the slowest periods long.

    Joints swing to alternate sides, so that the chain stays near the upright.

    Args:
        njoint: the number of joints.
        natural_time: √(l/g) of the chain, in s; or whatever time periods are to be counted by.
        timestep: in s.
        amplitude: of the mean joint, in rad, or of each (njoint), in rad or m.
        periods: the fastest and the slowest, in natural times; that of each joint is drawn between them.
    """
    fastest, slowest = periods
    random = np.random.default_rng(0)
    times = np.arange(0.0, 2.0 * slowest * natural_time, timestep)[:, None]
    rate = 2.0 * np.pi / (natural_time * random.uniform(fastest, slowest, njoint))
    half = amplitude / 2.0 * random.uniform(0.7, 1.3, njoint) * (-1.0) ** np.arange(njoint)
    angles, speeds = half * (1.0 - np.cos(rate * times)), half * rate * np.sin(rate * times)
    return Trajectory(angles, speeds, half * rate**2 * np.cos(rate * times))


def track(
    plant: SimulatedPlant, start: Any, model: Controlled, feedback: Controlled, desired: Trajectory, bandwidth: float
) -> Array:
    """Drives a plant along `desired` with computed torque.

    τ = M̃(q) q̈_d + h̃ + g̃ + M̄(q) (k_p e + k_d ė), critically damped. Friction and Coriolis forces are those at the
    wanted speeds: where a joint sticks, its own tell nothing of the torque that it needs to move.

    Args:
        plant: that moves.
        start: what brings it to rest where the motion begins.
        model: of the feedforward, M̃, h̃ and g̃.
        feedback: what M̄ is of. It should be of a possible robot: a mass matrix that is not positive definite turns the
            feedback against itself.
        desired: the trajectory.
        bandwidth: of the feedback, in rad/s.

    Returns:
        Joint coordinates (nseen x njoint), in rad or m, up to where control was lost.
    """
    plant.push(start)
    seen = []
    for angle, speed, acceleration in zip(desired.angles, desired.speeds, desired.accelerations, strict=True):
        angles, speeds = plant.states()
        if not np.abs(angle - angles).max() <= LOST:
            break
        seen.append(angles)
        correction = bandwidth**2 * (angle - angles) + 2.0 * bandwidth * (speed - speeds)
        torque = model.inverse_dynamics(angles, speed, acceleration) + feedback.mass_matrix(angles) @ correction
        plant.apply_torque(torque)
        plant.step()
    plant.stop()
    return np.array(seen)
