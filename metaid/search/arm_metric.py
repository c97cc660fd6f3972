"""How the kinetic measure of an arm grows away from the truth, and coordinates in which it is nearly round."""

from __future__ import annotations

import numpy as np

from metaid.episode import Episode
from metaid.models import Array
from metaid.models.tree import PARAMETERS, ArmPrior, joint_mass_matrix, torque_columns
from metaid.search.coordinates import Coordinates

SAMPLES = 20  # of the motion after each push
ROTOR = PARAMETERS.index("rotor")
SPREAD = 0.3  # root mean square of a coordinate's prior
LEAST_SHOWN = 0.005  # of the mean: what an independent step of the prior counts for at least, however little it shows


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


def prior_metric(h: Array, prior: ArmPrior, low: Array, high: Array) -> Coordinates:
    """Coordinates in which the kinetic measure is round, but for what it hardly shows, which is not stretched beyond
    its prior.  Eq. 63.

    Args:
        h: the measure's sensitivity (nbase x nbase).
        prior: of the arm; its base parameters are the start.
        low: bounds of the base parameters (nbase).
        high: bounds of the base parameters (nbase).
    """
    values, vectors = np.linalg.eigh(prior.root.T @ h @ prior.root)
    mean = float(values.mean())
    stretched = vectors / np.sqrt(np.maximum(values, 0.0) + LEAST_SHOWN * mean) @ vectors.T
    unit = np.sqrt(mean) / SPREAD
    curvature = (unit / (2.0 * np.pi)) ** 2
    return Coordinates(prior.values, unit * prior.root @ stretched, low, high, curvature)


def _ideal_motion(episode: Episode, timestep: float) -> tuple[Array, Array, Array]:
    """Joint coordinates, speeds and accelerations (npush SAMPLES x njoint each) of an arm under its own law."""
    times = (np.arange(SAMPLES) + 0.5) * episode.steps * timestep / SAMPLES
    rate = np.sqrt(episode.springs)[:, None]
    swing = np.where(rate > 0.0, np.sin(rate * times) / np.where(rate > 0.0, rate, 1.0), times)[..., None]
    poses, speeds = episode.states[:, None, 0], episode.states[:, None, 1]
    pulled = -(rate**2)[..., None] * swing
    motion = poses + speeds * swing, speeds * np.cos(rate * times)[..., None], speeds * pulled
    positions, moving, accelerated = (each.reshape(-1, episode.states.shape[2]) for each in motion)
    return positions, moving, accelerated
