"""How the spectral measure of a chain, and the kinetic one of an arm, grow away from exact compensation, by the nominal
model alone, before any trial.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from metaid.episode import Episode, rich_speeds
from metaid.models import IDEAL, Array, Chain, compensation_basis
from metaid.models.tree import PARAMETERS, ArmPrior, joint_mass_matrix, torque_columns
from metaid.search.coordinates import LEAST_SENSITIVITY

DESIGNS = 64  # push sets that a designed one is the best of
SAMPLES, ARM_SAMPLES = 40, 20  # of the motion after each push, of a chain and of an arm
ROTOR = PARAMETERS.index("rotor")


def sensitivity(
    nominal: Chain, gravity: float, start_speeds: Array, horizon: float, kinds: Sequence[str] = IDEAL
) -> Array:
    """H (nlump x nlump), in rad²/s²: near exact compensation (2π spectral_hz)² = δᵀ H δ, with δ the error of the
    factors.  Eq. 15.

    The motion about which H is taken needs no simulation. At exact compensation every push coasts, φ(t) = ω t.

    Args:
        nominal: the links of the nominal model.
        gravity: in m/s².
        start_speeds: absolute link speeds after each push (npush x nlink), in rad/s.
        horizon: how long each push is watched, in s.
        kinds: of the lumps whose factors δ is of.
    """
    times = (np.arange(SAMPLES) + 0.5) * horizon / SAMPLES
    angles = start_speeds[:, None, :] * times[None, :, None]
    speeds = np.broadcast_to(start_speeds[:, None, :], angles.shape)
    force = compensation_basis(angles, speeds, gravity, kinds) * nominal.lumps_of(kinds).vector
    acceleration = np.linalg.solve(nominal.mass_matrix(angles), force)
    joint_acceleration = np.diff(acceleration, axis=-2, prepend=0.0)
    joint_speeds = np.diff(start_speeds, axis=-1, prepend=0.0)
    energy = (joint_speeds**2).sum() * SAMPLES
    flat = (joint_acceleration / np.sqrt(energy)).reshape(-1, force.shape[-1])
    h: Array = flat.T @ flat
    return h


def designed_speeds(
    nominal: Chain,
    gravity: float,
    count: int,
    peak_speed: float,
    horizon: float,
    seed: int,
    kinds: Sequence[str] = IDEAL,
) -> Array:
    """Absolute link speeds (count x nlink), in rad/s, of the best of many rich push sets, by the nominal model.

    The best set is the one that determines its least determined lump best: its largest diagonal element of H⁻¹ is the
    least of all sets'.  Eq. 17.

    Args:
        nominal: the links of the nominal model.
        gravity: in m/s².
        count: pushes of a set.
        peak_speed: of the fastest link after a push, in rad/s.
        horizon: how long each push is watched, in s.
        seed: of the sets.
        kinds: of the lumps that are to be determined.
    """

    def worst(speeds: Array) -> float:
        values, vectors = np.linalg.eigh(sensitivity(nominal, gravity, speeds, horizon, kinds))
        if not values[0] > LEAST_SENSITIVITY * values[-1]:
            return np.inf
        return float(np.diag(vectors / values @ vectors.T).max())

    seeds = np.random.default_rng(seed).integers(2**32, size=DESIGNS)
    sets = [peak_speed * rich_speeds(nominal.nlink, count, int(drawn)) for drawn in seeds]
    return min(sets, key=worst)


def arm_sensitivity(prior: ArmPrior, episode: Episode, timestep: float, values: Array | None = None) -> Array:
    """H (nbase x nbase), in rad²/s² over the squared units: near the truth (2π f)² = δᵀ H δ of the kinetic measure f,
    with δ the error of the base parameters.  Eq. 62.

    The motion about which H is taken needs no simulation: joints coast, or swing as on springs.

    Args:
        prior: whose nominal arm is the metric.
        episode: the pushes.
        timestep: in s.
        values: base parameters (nbase) of an arm whose mass matrix moves. By default it is the nominal one's, with
            rotors heavier by a standard deviation of their prior. Of a wrist whose rotor was taken for
            nothing the nominal mass matrix is far too light.
    """
    nominal = prior.nominal
    positions, speeds, accelerations = _ideal_motion(episode, timestep)
    metric = np.array([joint_mass_matrix(nominal, position) for position in positions])
    if values is None:
        variances = np.diag(prior.parameter_covariance).reshape(nominal.njoint, -1)
        mass = metric + np.diag(np.sqrt(variances[:, ROTOR]))
    else:
        moving = prior.tree_at(values)
        mass = np.array([joint_mass_matrix(moving, position) for position in positions])
    columns = torque_columns(nominal, prior.base.columns, positions, speeds, accelerations)
    accelerated = np.linalg.solve(mass, columns)  # M⁻¹ Y of Eq. 58
    flat = (np.linalg.cholesky(metric).transpose(0, 2, 1) @ accelerated).reshape(-1, columns.shape[-1])
    h: Array = flat.T @ flat / np.einsum("ti,tij,tj->", speeds, metric, speeds)
    return h


def _ideal_motion(episode: Episode, timestep: float) -> tuple[Array, Array, Array]:
    """Joint coordinates, speeds and accelerations (npush ARM_SAMPLES x njoint each) of an arm under its own law."""
    times = (np.arange(ARM_SAMPLES) + 0.5) * episode.steps * timestep / ARM_SAMPLES
    rate = np.sqrt(episode.springs)[:, None]
    swing = np.where(rate > 0.0, np.sin(rate * times) / np.where(rate > 0.0, rate, 1.0), times)[..., None]
    poses, speeds = episode.states[:, None, 0], episode.states[:, None, 1]
    pulled = -(rate**2)[..., None] * swing
    motion = poses + speeds * swing, speeds * np.cos(rate * times)[..., None], speeds * pulled
    positions, moving, accelerated = (each.reshape(-1, episode.states.shape[2]) for each in motion)
    return positions, moving, accelerated
