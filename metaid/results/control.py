"""Computed-torque control of a chain along a joint trajectory: what identified lumps are good for.

The feedforward is the candidate's. The feedback is the same whatever the candidate. So candidates are compared by their
lumps alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models import Array, ChainModel
from metaid.plant import MujocoPlant

AMPLITUDE = 0.5  # rad, of the mean joint's sinusoid
PERIODS = 6.0, 12.0  # fastest and slowest of the joints' sinusoids, in natural times
BANDWIDTH = 3.0  # of the feedback, in rad per natural time
LOST = np.pi  # rad off the trajectory: out of control


@dataclass(frozen=True)
class Motion:
    """Joint `angles` in rad, `speeds` in rad/s and `accelerations` in rad/s² over time, each (nsteps x njoint)."""

    angles: Array
    speeds: Array
    accelerations: Array


@dataclass(frozen=True)
class Tracked:
    """What was seen of a plant along a trajectory: joint `angles` (rad), `speeds` (rad/s), and the `torques` (N m)
    that held from each step to the next, all (nsteps x njoint)."""

    angles: Array
    speeds: Array
    torques: Array


def smooth_sinusoids(
    njoint: int,
    natural_time: float,
    timestep: float,
    seed: int = 0,
    harmonics: int = 1,
    amplitude: float | Array = AMPLITUDE,
    periods: tuple[float, float] = PERIODS,
) -> Motion:
    """A joint trajectory from rest upright, two of the slowest periods long.

    Joints swing to alternate sides, so that the chain stays near the upright.

    Args:
        njoint: the number of joints.
        natural_time: √(l/g) of the chain, in s; or whatever time periods are to be counted by.
        timestep: in s.
        seed: of the random periods and amplitudes.
        harmonics: sinusoids in the motion of each joint.
        amplitude: of the mean joint, in rad, or of each (njoint), in rad or m.
        periods: the fastest and the slowest, in natural times; each sinusoid's period is drawn between them.
    """
    fastest, slowest = periods
    random = np.random.default_rng(seed)
    times = np.arange(0.0, 2.0 * slowest * natural_time, timestep)[:, None]
    angles, speeds, accelerations = (np.zeros((len(times), njoint)) for _ in range(3))
    for _ in range(harmonics):
        rate = 2.0 * np.pi / (natural_time * random.uniform(fastest, slowest, njoint))
        half = amplitude / 2.0 / harmonics * random.uniform(0.7, 1.3, njoint) * (-1.0) ** np.arange(njoint)
        angles += half * (1.0 - np.cos(rate * times))
        speeds += half * rate * np.sin(rate * times)
        accelerations += half * rate**2 * np.cos(rate * times)
    return Motion(angles, speeds, accelerations)


def track(plant: MujocoPlant, model: ChainModel, feedback: ChainModel, desired: Motion, bandwidth: float) -> Tracked:
    """Drives the plant from rest upright along `desired` with computed torque from `model`.

    τ = M̃(φ) q̈_d + h̃ + g̃ + M̄(φ) (k_p e + k_d ė), critically damped.

    Args:
        plant: it is brought to rest upright first.
        model: of the feedforward.
        feedback: what M̄ is of. It should be of a possible chain: a mass matrix that is not positive definite turns the
            feedback against itself.
        desired: the trajectory.
        bandwidth: of the feedback, in rad/s.

    Returns:
        What was seen; it ends early where control is lost.
    """
    from metaid.compiled import track_compiled

    laws = model.lumps, feedback.lumps
    inertias = model.lumps.of("inertia"), feedback.lumps.of("inertia")
    motion = desired.angles, desired.speeds, desired.accelerations
    return Tracked(*track_compiled(plant, laws, inertias, motion, bandwidth, LOST))
