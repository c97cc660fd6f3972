"""Individual parameters in place of lumps: masses and centres of mass of links whose lengths are known.

Gravity lumps are linear in the masses m_i and the first moments s_i = m_i c_i (Eq. 1), and with the lengths known they
fix all Coriolis lumps (Eq. 2). So 2 nlink parameters have nlink lumps between them: what a search can find is a *set*
of bodies, which all move the same (Eq. 20). The inertias I_i are in none of these lumps and are not among the
parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from metaid.chain import Array, Chain, Lumps
from metaid.coordinates import Coordinates

ACTIVE = 1e-9  # relative slack below which a bound of the set is reached
CLIMB = 40  # moves per link towards an end of the set; a handful is enough to get from corner to corner
SHORT_OF_TIP = 1.0 - 1e-6  # of a link's length: a body with its centre of mass at the very tip is a point


@dataclass(frozen=True)
class Bodies:
    """What candidates' factors are of: the `mass` (kg) and centre of mass `com` (m, from the joint) of links of known
    `length` (m), each (nlink). Factors (2 nlink) are of all masses, then of all centres of mass.
    """

    length: Array
    mass: Array
    com: Array

    @property
    def nlink(self) -> int:
        return len(self.length)

    @property
    def names(self) -> list[str]:
        """`mass_1` … `mass_n`, then `com_1` … : the parameters of a study."""
        return [f"{kind}_{i}" for kind in ("mass", "com") for i in range(1, self.nlink + 1)]

    @property
    def units(self) -> list[str]:
        """Of each parameter (2 nlink)."""
        return ["kg"] * self.nlink + ["m"] * self.nlink

    @cached_property
    def vector(self) -> Array:
        """The nominal parameters in the order of `names` (2 nlink)."""
        return np.concatenate([self.mass, self.com])

    @cached_property
    def farthest(self) -> Array:
        """The factors (2 nlink) up to which there is such a body: a centre of mass is on its link, short of the tip."""
        return np.concatenate([np.full(self.nlink, np.inf), SHORT_OF_TIP * self.length / self.com])

    def scaled(self, factors: Array) -> Lumps:
        """The lumps of bodies with these `factors` (... x 2 nlink) of the nominal parameters.  Eqs. 1 and 2."""
        mass, com = np.split(self.vector * factors, 2, axis=-1)
        outboard = np.cumsum(mass[..., ::-1], axis=-1)[..., ::-1] - mass
        gravity = mass * com + self.length * outboard
        coriolis = np.triu(self.length[:, None] * gravity[..., None, :], 1)
        return Lumps(gravity, coriolis + coriolis.swapaxes(-1, -2))


def bodies_of(chain: Chain) -> Bodies:
    """The bodies that a chain's links are."""
    return Bodies(chain.length, chain.mass, chain.com)


@dataclass(frozen=True, kw_only=True)
class BodyCoordinates(Coordinates):
    """The searcher moves in log m and in the logit of c / l, measured from the factors `origin` (2 nlink): whatever it
    proposes has a positive mass, and a centre of mass on its link.  Factors are kept between `low` and `high`.  Eq. 21.
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

    def lump_factors(self, factors: Array) -> Array:
        """The factors of the lumps (... x nlump) of bodies with these `factors` (... x 2 nlink)."""
        first, second = np.triu_indices(self.bodies.nlink, 1)
        lumps = [self.bodies.scaled(each) for each in (factors, np.ones(len(self.low)))]
        vectors = [np.concatenate([each.gravity, each.coriolis[..., first, second]], axis=-1) for each in lumps]
        ratio: Array = vectors[0] / vectors[1]
        return ratio


def body_space(nominal: Chain, start: Array, low: Array, high: Array) -> BodySpace:
    """The space about the nominal links, with centres of mass on their links whatever `high` says."""
    bodies = bodies_of(nominal)
    return BodySpace(bodies, start, low, np.minimum(high, bodies.farthest))


class SameMotion:
    """The set of all bodies within bounds `low` and `high` (2 nlink factors) that move as the one of `factors` does.

    Their masses fill a polytope, for with the gravity lumps given the first moments are linear in the masses, and so
    are the bounds.  Eq. 20.
    """

    def __init__(self, bodies: Bodies, factors: Array, low: Array, high: Array) -> None:
        n = bodies.nlink
        self._bodies = bodies
        self._gravity = bodies.scaled(factors).gravity
        self._outboard = np.triu(np.ones((n, n)), 1) * bodies.length[:, None]  # s = μ − this m
        self.start: Array = bodies.mass * factors[:n]
        least, most = np.split(bodies.vector * low, 2), np.split(bodies.vector * high, 2)
        each = np.eye(n)
        self._rows = np.concatenate(
            [-each, each, self._outboard + np.diag(least[1]), -self._outboard - np.diag(most[1])]
        )
        self._limits = np.concatenate([-least[0], most[0], self._gravity, -self._gravity])

    def factors(self, mass: Array) -> Array:
        """The factors (2 nlink) of the body with these masses (nlink), in kg."""
        moment = self._gravity - self._outboard @ mass
        return np.concatenate([mass, moment / mass]) / self._bodies.vector

    def ends(self, random: np.random.Generator) -> list[Array]:
        """The masses (nlink) at which each parameter is least and at which it is largest, by the order of names."""
        parameters = range(2 * self._bodies.nlink)
        return [self._end(parameter, sign, random) for parameter in parameters for sign in (-1.0, 1.0)]

    def random_point(self, mass: Array, random: np.random.Generator) -> Array:
        """Masses (nlink) somewhere else in the set: along a random direction from `mass`, evenly within the bounds."""
        direction = random.normal(size=len(mass)) * self._bodies.mass
        back, forth = self._chord(mass, direction)
        return mass + random.uniform(back, forth) * direction

    def _end(self, parameter: int, sign: float, random: np.random.Generator) -> Array:
        """Climbs along edges: a parameter is monotone along every straight line of masses, so its ends are corners."""
        mass, scale = self.start, self._bodies.mass
        for _ in range(CLIMB * len(mass)):
            active = self._rows[self._slack(mass) <= ACTIVE] * scale
            kept = random.permutation(active)[: random.integers(0, len(mass)) if len(active) else 0]
            direction = random.normal(size=len(mass))
            if len(kept):
                direction -= np.linalg.pinv(kept) @ (kept @ direction)
            back, forth = self._chord(mass, scale * direction)
            ends = [mass + step * scale * direction for step in (back, 0.0, forth)]
            mass = max(ends, key=lambda end: sign * float(self.factors(end)[parameter]))
        return mass

    def _slack(self, mass: Array) -> Array:
        """Room left before each bound (4 nlink), relative to the bodies' own size."""
        slack: Array = (self._limits - self._rows @ mass) / (np.abs(self._rows) @ self._bodies.mass)
        return slack

    def _chord(self, mass: Array, direction: Array) -> tuple[float, float]:
        """How far one can go from `mass` against and along `direction` before a bound is met."""
        speed = self._rows @ direction
        room = np.maximum(self._limits - self._rows @ mass, 0.0)
        met = np.abs(speed) > ACTIVE * (np.abs(self._rows) @ self._bodies.mass)
        steps = room[met] / speed[met]
        return float(steps[speed[met] < 0.0].max(initial=-1e9)), float(steps[speed[met] > 0.0].min(initial=1e9))
