"""Changes of coordinates between what a searcher moves in and the factors that are tried and stored.

`plain`: the factors themselves. `nominal-metric`: factor = start + L z, with L Lᵀ ∝ H⁻¹. By H the nominal model alone
says how the spectral measure grows away from exact compensation. In z the landscape is nearly round, whatever the
number of links.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from metaid.errors import EpisodeError
from metaid.models import Array
from metaid.models.tree import ArmPrior

LEAST_SENSITIVITY = 1e-12  # relative to the largest; a combination of lumps with less cannot be determined
SPREAD = 0.3  # root mean square of a coordinate's prior
LEAST_SHOWN = 0.005  # of the mean: what an independent step of the prior counts for at least, however little it shows


@dataclass(frozen=True)
class Coordinates:
    """factor = `origin` + `spread` @ z, with the factors kept between `low` and `high`, all (nlump); z = 0 is the
    start.  Eq. 16.

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


def plain_coordinates(start: Array, low: Array, high: Array) -> Coordinates:
    """The factors themselves, measured from `start`; all (nlump)."""
    return Coordinates(start, np.eye(len(start)), low, high)


def nominal_metric(h: Array, plain: Coordinates) -> Coordinates:
    """Coordinates from the same start and within the same bounds as `plain` ones in which the spectral measure is
    round, by its sensitivity H (nlump x nlump), in rad²/s², with the least determined factor at unit spread.  Eq. 16.

    Raises EpisodeError where the pushes do not determine some combination of lumps.
    """
    values, vectors = np.linalg.eigh(h)
    if not values[0] > LEAST_SENSITIVITY * values[-1]:
        raise EpisodeError(
            "these pushes cannot tell all lumps apart, so there is no nominal metric: "
            "use pushes = 'rich' or coordinates = 'plain'"
        )
    root = vectors / np.sqrt(values) @ vectors.T
    unit = np.diag(root @ root).max()
    return replace(plain, spread=root / np.sqrt(unit), curvature=1.0 / (unit * (2.0 * np.pi) ** 2))


def prior_metric(h: Array, prior: ArmPrior, plain: Coordinates) -> Coordinates:
    """Those in which the kinetic measure is round, by its sensitivity H (nbase x nbase), but for what it hardly shows,
    which is not stretched beyond the `prior` of the arm.  Eq. 63.
    """
    values, vectors = np.linalg.eigh(prior.root.T @ h @ prior.root)
    mean = float(values.mean())
    stretched = vectors / np.sqrt(np.maximum(values, 0.0) + LEAST_SHOWN * mean) @ vectors.T
    unit = np.sqrt(mean) / SPREAD
    return replace(plain, spread=unit * prior.root @ stretched, curvature=(unit / (2.0 * np.pi)) ** 2)
