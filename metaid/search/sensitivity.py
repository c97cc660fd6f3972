"""How the spectral measure grows away from exact compensation, by the nominal model alone, before any trial."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from metaid.episode import rich_speeds
from metaid.models import IDEAL, Array, Chain, compensation_basis
from metaid.search.coordinates import LEAST_SENSITIVITY

DESIGNS = 64  # push sets that a designed one is the best of
SAMPLES = 40  # of the coasting motion after each push


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
