"""All bodies that lumps leave possible: how small and how large each link's mass, centre of mass and inertia can be.

With W_i = Σ_{k≥i} m_k, the mass of link i and of all that it carries, the moments of link i alone are linear in its
lumps and in W_{i+1} (Eq. 19). A body is possible if its mass is positive, its centre of mass on the link and its
inertia not negative (Eq. 20). With lumps that are known exactly, the ends of the set follow from its corners (Eq. 21).
With uncertain lumps sequential quadratic programming goes on from there. The set is convex then, but for logarithms.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.models.known_lumps import KnownLumps
from metaid.models.lumps import Array

LONG = 10.0  # of what a centre of mass can be at: a length that is not known bounds nothing
TINY = 1e-12  # in place of a denominator that is 0
COMPLEX_STEP = 1e-30  # of a derivative, which is exact to rounding
EXACT = 1e-7  # of a lump: better known lumps are taken as they are
LOOSELY = 1e-6  # of its size: so far an inequality may be violated
ROOM = 3.0  # beyond what a point can be with the lumps themselves
PRECISELY, MOST_STEPS = 1e-10, 200


def body_extents(known: KnownLumps) -> Array | None:
    """The least and the largest value (2 x nparameter) of each parameter over all possible bodies with such lumps, in
    the order of `known.names`; infinite where there is no largest. None where no body has the lumps themselves.
    """
    bodies = _Bodies(known)
    if not (bodies.least <= bodies.most).all():
        return None
    found = {end: bodies.corner(end) for end in bodies.ends}
    if bodies.are_uncertain:
        for end in bodies.ends:
            found[end] = bodies.farther(found[end], bodies.inside(end), end)
        for end in bodies.ends:  # the body that is farthest out here of those at other ends may lead farther
            others = (point for other, point in found.items() if other != end)
            start = min(others, key=lambda point, end=end: bodies.value(point, end))  # type: ignore[misc]
            found[end] = bodies.farther(found[end], start, end)
    return bodies.table(found)


class _End(NamedTuple):
    """The least (`sign` 1) or the largest (−1) value of the parameter of one `kind` of a `link`, counted from 0."""

    kind: str
    link: int
    sign: int


class _Bodies:
    """The possible bodies with lumps that are `known`.

    A point has changes of the logarithms of what is known, in units in which these go about as far as the rest; then
    the centre of mass of the first link, whose mass has no bound, and W_2 … W_n, all as shares of what they can be.
    `least` and `most` (nlink + 1): W_1 … W_{n+1}, in kg, with the lumps that are known.
    """

    def __init__(self, known: KnownLumps) -> None:
        n, nlog = known.nlink, len(known.root)
        self._known, self._nlog = known, nlog
        longest = known.inertia / known.gravity
        self._length = np.where(np.isnan(known.length), LONG * longest, known.length)
        self._values = np.concatenate([known.gravity, known.inertia, self._length])
        self._width = float(np.linalg.norm(known.root, axis=1).max())
        self._root = np.vstack([known.root, np.zeros((3 * n - nlog, nlog))]) / np.sqrt(self._width)
        self.least, self.most = masses_beyond(known.gravity, known.inertia, self._length)
        self._unit = np.append(longest[0], self.most[1:n])
        self._sizes = {"mass": np.append(known.gravity[0] / longest[0], self._unit[1:]), "com": longest}
        self._sizes["inertia"] = known.inertia
        round_about = np.sqrt(self._width)
        self._bounds = [(-round_about, round_about)] * nlog + [(TINY, ROOM * self._length[0] / longest[0])]
        self._bounds += [(0.0, ROOM)] * (n - 1)

    @property
    def ends(self) -> list[_End]:
        """All that are looked for: no lump bounds the mass of the first link."""
        kinds, links = ("mass", "com", "inertia"), range(self._known.nlink)
        every = [_End(kind, link, sign) for kind in kinds for link in links for sign in (1, -1)]
        return [end for end in every if end not in (("mass", 0, -1), ("com", 0, 1))]

    @property
    def are_uncertain(self) -> bool:
        """Whether the lumps are so uncertain that it shows in the ends."""
        return self._width > EXACT

    def corner(self, end: _End) -> Array:
        """The body at an `end` that has exactly the lumps that are known.

        Parameters of link i depend on W_i and W_{i+1}. With the lumps given each is monotone in both, but for the least
        mass by W_{i+1}.  Eq. 21.
        """
        kind, i, sign = end
        mu, d, length = self._known.gravity[i], self._known.inertia[i], self._length[i]
        low, high = self.least[i + 1], self.most[i + 1]
        beyond = high if (kind, sign) == ("com", 1) else low
        if (kind, sign) == ("mass", 1):  # where s²/J is least, or s/l
            beyond = min(max((2.0 * d - length * mu) / length**2, low), high) if length * mu > d else high
        first, second = mu - length * beyond, d - length**2 * beyond
        is_heavy = (kind, sign) in (("mass", -1), ("inertia", -1), ("com", 1))
        mass = self.most[i] - beyond if is_heavy else _least_mass(first, second, length)
        masses = np.concatenate([self.most[:i], [beyond + mass, beyond], self.least[i + 2 :]])
        com = first / mass if mass > 0.0 else length
        return self._point(com if i == 0 else 0.0, masses[1:-1])

    def inside(self, end: _End) -> Array:
        """A body between the `corner` and the middle of the set."""
        beyond = 0.5 * (self.least + self.most)[1:]
        first = self._known.gravity[0] - self._length[0] * beyond[0]
        second = self._known.inertia[0] - self._length[0] ** 2 * beyond[0]
        middle = self._point(0.5 * min(self._length[0], second / first), beyond[:-1])
        return 0.5 * (middle + self.corner(end))

    def _point(self, com: float, masses: Array) -> Array:
        """That of the first link's centre of mass, in m, and of W_2 … W_n, in kg, with the lumps that are known."""
        return np.concatenate([np.zeros(self._nlog), np.append(com, masses) / self._unit])

    def value(self, point: Array, end: _End) -> float:
        """What is least at an `end`, as a share of the parameter's size."""
        return float(self._objective(point, end))

    def farther(self, known: Array, start: Array, end: _End) -> Array:
        """The body from `start` on that is farthest out at an `end`; the `known` one where none is farther."""
        from scipy.optimize import minimize  # slow to load, and only who asks for bodies needs it

        def objective(points: NDArray[Any]) -> NDArray[Any]:
            return self._objective(points, end)

        found = minimize(
            objective,
            start,
            jac=lambda point: _derivative(objective, point),
            method="SLSQP",
            bounds=self._bounds,
            constraints={
                "type": "ineq",
                "fun": self._inequalities,
                "jac": lambda point: _derivative(self._inequalities, point).T,
            },
            options={"ftol": PRECISELY, "maxiter": MOST_STEPS},
        )
        is_possible = np.isfinite(found.x).all() and self._inequalities(found.x).min() > -LOOSELY
        return found.x if is_possible and found.fun < self.value(known, end) else known

    def table(self, found: dict[_End, Array]) -> Array:
        """The extents (2 x nparameter) from a point at each end."""
        names, n = self._known.names, self._known.nlink
        table = np.tile([[0.0], [np.inf]], len(names))
        for end, point in found.items():
            value = end.sign * self.value(point, end) * self._sizes[end.kind][end.link]
            table[0 if end.sign > 0 else 1, names.index(f"{end.kind}_{end.link + 1}")] = max(value, 0.0)
        if len(names) > 3 * n:
            reach = np.linalg.norm(self._known.root[2 * n :], axis=1)
            table[:, 3 * n : -1] = self._known.length[:-1] * np.exp([-reach, reach])
            table[0, -1] = table[0, 2 * n - 1]  # the last link is as long as its centre of mass is far out
        return table

    def _links(self, points: NDArray[Any]) -> tuple[NDArray[Any], ...]:
        """Of each link (... x nlink) the moments s and J and the length, and two numbers whose ratio is its centre of
        mass.  Eq. 19.
        """
        gravity, inertia, length = np.split(self._values * np.exp(points[..., : self._nlog] @ self._root.T), 3, axis=-1)
        com, masses = np.split(points[..., self._nlog :] * self._unit, [1], axis=-1)
        beyond = np.concatenate([masses, np.zeros_like(com)], axis=-1)
        first, second = gravity - length * beyond, inertia - length**2 * beyond
        above = np.concatenate([com, first[..., 1:]], axis=-1)
        below = np.concatenate([np.ones_like(com), beyond[..., :-1] - beyond[..., 1:]], axis=-1)
        return first, second, length, above, below

    def _inequalities(self, points: NDArray[Any]) -> NDArray[Any]:
        """What is not negative of possible bodies (... x ninequality), as shares of its size.  Eq. 20."""
        first, second, length, above, below = self._links(points)
        changes, size = points[..., : self._nlog], np.append(1.0, self._unit[1:])
        parts = [
            first / self._known.gravity,
            second / self._known.inertia,
            (length * below - above) / (self._length * size),
            (second * below - first * above) / (self._known.inertia * size),
            self._width - (changes * changes).sum(axis=-1, keepdims=True),
        ]
        return np.concatenate(parts, axis=-1)

    def _objective(self, points: NDArray[Any], end: _End) -> NDArray[Any]:
        """What is least at an `end` (...)."""
        first, second, length, above, below = (part[..., end.link] for part in self._links(points))
        com = above / (below + TINY)
        parameter = {
            "mass": below if end.link else first / (com + TINY),
            "com": com,
            # A centre of mass at the tip leaves the least inertia that these lumps allow, if that is not negative.
            "inertia": second - first * (com if end.sign < 0 else length),
        }
        return np.asarray(end.sign * parameter[end.kind] / self._sizes[end.kind][end.link])


def _derivative(function: Callable[[NDArray[Any]], NDArray[Any]], point: Array) -> Array:
    """The derivative (npoint x ...) of an analytic `function` by a complex step."""
    steps = point + COMPLEX_STEP * 1j * np.eye(len(point))
    return np.asarray(function(steps).imag / COMPLEX_STEP)


def _least_mass(first: float, second: float, length: float) -> float:
    """The least mass of a link with these moments about its joint: its centre of mass on it, no inertia negative."""
    return max(first / length, first**2 / second)


def masses_beyond(gravity: Array, inertia: Array, length: Array) -> tuple[Array, Array]:
    """The least and the largest W_i (nlink + 1), in kg, of i = 1 … n + 1, of bodies with exactly these lumps. A least
    one that is larger than the largest says that no body is possible.  Eq. 21.

    Args:
        gravity: μ (nlink), in kg m.
        inertia: d (nlink), in kg m².
        length: l (nlink), in m.
    """
    n = len(gravity)
    least, most = np.zeros(n + 1), np.append(np.full(n, np.inf), 0.0)
    for i in reversed(range(n)):
        first, second = gravity[i] - length[i] * least[i + 1], inertia[i] - length[i] ** 2 * least[i + 1]
        if first <= 0.0 or second <= 0.0:
            return np.ones(n + 1), np.zeros(n + 1)
        least[i] = least[i + 1] + _least_mass(first, second, length[i])
    for i in range(n - 1):
        short = length[i] * gravity[i] - inertia[i]
        if short > 0.0:
            about_tip = max(length[i] ** 2 * most[i] - length[i] * gravity[i] - short, TINY * inertia[i])
            most[i + 1] = (inertia[i] - short**2 / about_tip) / length[i] ** 2
        else:
            most[i + 1] = gravity[i] / length[i]
    return least, most
