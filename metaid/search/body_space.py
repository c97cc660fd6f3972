"""The coordinates in which a search for individual parameters moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models import Array, Bodies, Chain, bodies_of
from metaid.search.coordinates import Coordinates


@dataclass(frozen=True, kw_only=True)
class BodyCoordinates(Coordinates):
    """The searcher moves in log m and in the logit of c / l, measured from the factors `origin` (2 nlink).  Eq. 21.

    So every candidate has positive masses, and each centre of mass is on its link. Factors are kept between `low` and
    `high`.
    """

    bodies: Bodies

    def factors(self, z: Array) -> Array:
        """Factors (2 nlink) at z (2 nlink), moved to the nearest bound where they are beyond it."""
        mass, com = np.split(self._unbounded(self.origin) + z, 2)
        share = 1.0 / (1.0 + np.exp(-com))
        parameters = np.concatenate([np.exp(mass), self.bodies.length * share])
        return np.clip(parameters / self.bodies.vector, self.low, self.high)

    def inside(self, z: Array) -> bool:
        """Whether z means factors within the bounds."""
        low, high = self.box()
        return bool(np.all((low <= z) & (z <= high)))

    def z(self, factors: Array) -> Array:
        """The z (2 nlink) of `factors` (2 nlink)."""
        return self._unbounded(factors) - self._unbounded(self.origin)

    def box(self) -> tuple[Array, Array]:
        """The bounds in z, low and high (2 nlink)."""
        return self.z(self.low), self.z(self.high)

    def _unbounded(self, factors: Array) -> Array:
        """log m and the logit of c / l (2 nlink)."""
        mass, com = np.split(self.bodies.vector * factors, 2)
        return np.concatenate([np.log(mass), np.log(com) - np.log(self.bodies.length - com)])


@dataclass(frozen=True)
class BodySpace:
    """What a search of individual parameters looks through: `bodies`, and factors (2 nlink) of their parameters to
    `start` from and to stay between, `low` and `high`.
    """

    bodies: Bodies
    start: Array
    low: Array
    high: Array

    @property
    def names(self) -> list[str]:
        """Of the parameters (2 nlink)."""
        return self.bodies.names

    @property
    def coordinates(self) -> BodyCoordinates:
        """What the searcher moves in."""
        each = np.eye(len(self.start))
        return BodyCoordinates(origin=self.start, spread=each, low=self.low, high=self.high, bodies=self.bodies)

    def parameters(self, values: Array) -> Array:
        """The lumps (... x nlump) of bodies with these factors, `values` (... x 2 nlink).  Eqs. 1 and 2."""
        return self.bodies.scaled(values).vector


def body_space(nominal: Chain, start: Array, low: Array, high: Array) -> BodySpace:
    """The space about the nominal links.

    Args:
        nominal: the links of the nominal model.
        start: factors (2 nlink) to start from.
        low: bounds of the factors (2 nlink).
        high: bounds of the factors (2 nlink); those of centres of mass are lowered to where these are on their link.
    """
    bodies = bodies_of(nominal)
    return BodySpace(bodies, start, low, np.minimum(high, bodies.farthest))
