"""The set of all bodies that move the same: what a search for individual parameters can find (Eq. 20)."""

from __future__ import annotations

import numpy as np

from metaid.models.bodies import Bodies
from metaid.models.lumps import Array

ROUNDING = 1e-6  # relative, of a bound that an end may be beyond
PARALLEL = 1e-9  # of a bound's own size: a direction that changes the masses less than that does not lead to it


class SameMotion:
    """The set of all bodies within bounds that move as a given one does.

    With the gravity lumps given, the first moments are linear in the masses, and so are the bounds. The masses
    therefore fill a polytope.  Eq. 20.

    Args:
        bodies: the nominal bodies, of which all factors are.
        factors: of the given body (2 nlink).
        low: bounds of the factors (2 nlink).
        high: bounds of the factors (2 nlink).
    """

    def __init__(self, bodies: Bodies, factors: Array, low: Array, high: Array) -> None:
        n = bodies.nlink
        self._bodies, self._low, self._high = bodies, low, high
        self._gravity = bodies.scaled(factors).gravity
        self._outboard = np.triu(np.ones((n, n)), 1) * bodies.length[:, None]  # s = μ − this m
        self.start: Array = bodies.mass * factors[:n]
        least, most = np.split(bodies.vector * low, 2), np.split(bodies.vector * high, 2)
        each = np.eye(n)
        # A body is in the set where these rows (4 nlink x nlink) times its masses are at most the limits (4 nlink).
        self._rows = np.concatenate(
            [-each, each, self._outboard + np.diag(least[1]), -self._outboard - np.diag(most[1])]
        )
        self._limits = np.concatenate([-least[0], most[0], self._gravity, -self._gravity])

    def factors(self, mass: Array) -> Array:
        """The factors (2 nlink) of the body with these masses (nlink), in kg."""
        moment = self._gravity - self._outboard @ mass
        return np.concatenate([mass, moment / mass]) / self._bodies.vector

    def ends(self) -> list[Array]:
        """The masses (nlink) at which each parameter is least and at which it is largest, by the order of names.

        Each is a corner of the polytope. Where several corners have the same end value, it is one of them.
        """
        n = self._bodies.nlink
        own_mass, one = np.eye(n, n + 1), np.eye(n + 1)[-1]
        moment = np.column_stack([-self._outboard, self._gravity])
        objectives = [(row, one) for row in own_mass] + list(zip(moment, own_mass, strict=True))
        return [self._least(sign * row, unit) for row, unit in objectives for sign in (1.0, -1.0)]

    def random_point(self, mass: Array, random: np.random.Generator) -> Array:
        """Masses (nlink) somewhere else in the set: along a random direction from `mass`, evenly within the bounds."""
        direction = random.normal(size=len(mass)) * self._bodies.mass
        back, forth = self._chord(mass, direction)
        return mass + random.uniform(back, forth) * direction

    def _least(self, objective: Array, unit: Array) -> Array:
        """The masses m (nlink) at which `objective` · (m, 1) / `unit` · (m, 1) is least; both (nlink + 1).

        This is a linear-fractional programme. In x = (m, 1) / `unit` · (m, 1) it is linear (Charnes and Cooper, 1962).
        """
        from scipy.optimize import linprog  # slow to load, and only the walk of a study of parameters needs it

        scale = np.append(self._bodies.mass, 1.0)
        rows = np.column_stack([self._rows, -self._limits]) * scale
        rows /= np.abs(rows[:, :-1]).sum(axis=1, keepdims=True)
        # The dual simplex method ends at a corner, and so at a bound to rounding.
        found = linprog(
            objective * scale, rows, np.zeros(len(rows)), (unit * scale)[None], [unit @ scale], method="highs-ds"
        )
        if found.success and (found.x > 0.0).all():
            mass: Array = self._bodies.mass * found.x[:-1] / found.x[-1]
            if self._holds(mass):
                return mass
        return self.start  # bounds are so far apart, a million times or more, that HiGHS's tolerance exceeds the least

    def _holds(self, mass: Array) -> bool:
        """Whether the body with these masses (nlink) is within the bounds, to rounding."""
        factors = self.factors(mass)
        low, high = (1.0 - ROUNDING) * self._low, (1.0 + ROUNDING) * self._high
        return bool(((low <= factors) & (factors <= high)).all())

    def _chord(self, mass: Array, direction: Array) -> tuple[float, float]:
        """How far one can go from `mass` against and along `direction` before a bound is met."""
        speed = self._rows @ direction
        room = np.maximum(self._limits - self._rows @ mass, 0.0)
        met = np.abs(speed) > PARALLEL * (np.abs(self._rows) @ self._bodies.mass)
        steps = room[met] / speed[met]
        return float(steps[speed[met] < 0.0].max(initial=-1e9)), float(steps[speed[met] > 0.0].min(initial=1e9))
