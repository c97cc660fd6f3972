"""Changes of coordinates between what a searcher moves in and the factors that are tried and stored.

`plain`: the factors themselves. `nominal-metric`: factor = start + L z, where L Lᵀ ∝ H⁻¹ and H is what the nominal
model alone says of how the spectral measure grows away from exact compensation: in z the landscape is nearly round,
whatever the number of links.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from metaid.chain import IDEAL, Array, Chain, compensation_basis
from metaid.episode import rich_speeds
from metaid.errors import EpisodeError

DESIGNS = 64  # push sets that a designed one is the best of
SAMPLES = 40  # of the coasting motion after each push
SMALLEST_EIGENVALUE = (
    1e-12  # relative to the largest; below it a combination of lumps cannot be told from its nominal value
)


@dataclass(frozen=True)
class Coordinates:
    """factor = `origin` + `spread` @ z, with the factors kept between `low` and `high`, all (nlump); z = 0 is the
    start.  Eq. 12.

    `curvature`: where it is known, κ in spectral_hz² ≈ κ |z − z*|², in Hz².
    """

    origin: Array
    spread: Array
    low: Array
    high: Array
    curvature: float | None = None

    def factors(self, z: Array) -> Array:
        """Factors (nlump) at z (nlump), moved to the nearest bound where they are beyond it."""
        return np.clip(self.origin + self.spread @ z, self.low, self.high)

    def inside(self, z: Array) -> bool:
        """Whether z means factors within the bounds."""
        factors = self.origin + self.spread @ z
        return bool(np.all((self.low <= factors) & (factors <= self.high)))

    def z(self, factors: Array) -> Array:
        """The z (nlump) of `factors` (nlump)."""
        return np.asarray(np.linalg.solve(self.spread, factors - self.origin), dtype=np.float64)

    def box(self) -> tuple[Array, Array]:
        """The least box in z, low and high (nlump), that holds every allowed change of each single coordinate of z."""
        room = np.where(self.spread != 0.0, np.abs(self.spread), np.nan)
        up = np.where(self.spread > 0.0, (self.high - self.origin)[:, None], (self.origin - self.low)[:, None])
        down = np.where(self.spread > 0.0, (self.origin - self.low)[:, None], (self.high - self.origin)[:, None])
        return -np.nanmin(down / room, axis=0), np.nanmin(up / room, axis=0)


def plain(start: Array, low: Array, high: Array) -> Coordinates:
    """The factors themselves, measured from `start`; all (nlump)."""
    return Coordinates(start, np.eye(len(start)), low, high)


def nominal_metric(h: Array, start: Array, low: Array, high: Array) -> Coordinates:
    """Coordinates in which the spectral measure, of sensitivity `h` (nlump x nlump), is round: least determined factor
    at unit spread.  Eq. 12.

    `start`, `low`, `high` (nlump).  Raises EpisodeError where the pushes tell nothing of some combination of lumps.
    """
    values, vectors = np.linalg.eigh(h)
    if not values[0] > SMALLEST_EIGENVALUE * values[-1]:
        raise EpisodeError(
            "these pushes cannot tell all lumps apart, so there is no nominal metric: "
            "use pushes = 'rich' or coordinates = 'plain'"
        )
    root = vectors / np.sqrt(values) @ vectors.T
    unit = np.diag(root @ root).max()
    return Coordinates(start, root / np.sqrt(unit), low, high, curvature=1.0 / (unit * (2.0 * np.pi) ** 2))


def sensitivity(
    nominal: Chain,
    gravity: float,
    start_speeds: Array,
    horizon: float,
    kinds: Sequence[str] = IDEAL,
    stiffness: float = 0.0,
) -> Array:
    """H (nlump x nlump), in rad²/s²: near exact compensation (2π spectral_hz)² = δᵀ H δ, with δ the error of the
    factors of the lumps of these `kinds`.  Eq. 11.

    At exact compensation every push coasts, φ(t) = ω t, or with a `stiffness` k (1/s²) swings, φ(t) = ω sin(√k t)/√k,
    so the motion about which H is taken needs no simulation. `start_speeds` (npush x nlink): absolute link speeds after
    each push, in rad/s; `horizon` in s.
    """
    times = (np.arange(SAMPLES) + 0.5) * horizon / SAMPLES
    rate = np.sqrt(stiffness)
    reached = np.sin(rate * times) / rate if stiffness else times
    angles = start_speeds[:, None, :] * reached[None, :, None]
    speeds = start_speeds[:, None, :] * np.cos(rate * times)[None, :, None]
    force = compensation_basis(angles, speeds, gravity, kinds, stiffness) * nominal.lumps_of(kinds).vector
    acceleration = np.linalg.solve(nominal.mass_matrix(angles), force)
    joint_acceleration = np.diff(acceleration, axis=-2, prepend=0.0)
    joint_speeds = np.diff(start_speeds, axis=-1, prepend=0.0)
    energy = (joint_speeds**2).sum() * (np.cos(rate * times) ** 2).sum()
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

    Best is the set whose least determined lump is determined best: the least largest diagonal element of H⁻¹ (Eq. 14).
    """

    def coarsest(speeds: Array) -> float:
        values, vectors = np.linalg.eigh(sensitivity(nominal, gravity, speeds, horizon, kinds))
        if not values[0] > SMALLEST_EIGENVALUE * values[-1]:
            return np.inf
        return float(np.diag(vectors / values @ vectors.T).max())

    seeds = np.random.default_rng(seed).integers(2**32, size=DESIGNS)
    sets = [peak_speed * rich_speeds(nominal.nlink, count, int(drawn)) for drawn in seeds]
    return min(sets, key=coarsest)
