"""The set of all bodies that move the same: what a search for individual parameters can find (Eq. 20)."""

from __future__ import annotations

import numpy as np

from metaid.models.bodies import Bodies
from metaid.models.lumps import Array

ACTIVE = 1e-9  # relative slack below which a bound of the set is reached

CLIMB = 40  # moves per link towards an end of the set; a handful is enough to get from corner to corner


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
