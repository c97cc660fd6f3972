"""A planar chain of links: its lumped parameters, and the law that compensates with them.

A chain of n links stands on its base. Link i has length l_i, mass m_i, centre of mass com_i (from its joint) and
inertia I_i (about its centre of mass). Absolute angles φ_i are measured from the upright, joint angles are q_i = φ_i
− φ_{i−1}. Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.errors import EpisodeError, unknown

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Chain:
    """Physical parameters of a chain, each (nlink,): `length` and `com` in m, `mass` in kg, `inertia` in kg m²,
    `damping` in N m s, `stiffness` in N m/rad.
    """

    length: Array
    mass: Array
    com: Array
    inertia: Array
    damping: Array
    stiffness: Array

    @property
    def nlink(self) -> int:
        return len(self.length)

    @cached_property
    def outboard_mass(self) -> Array:
        """Σ_{k>i} m_k, the mass that link i carries at its tip (nlink), in kg."""
        return np.cumsum(self.mass[::-1])[::-1] - self.mass

    @cached_property
    def lumps(self) -> Lumps:
        """The chain's own lumps.  Eqs. 1 and 2."""
        gravity = self.mass * self.com + self.length * self.outboard_mass  # Eq. 1
        coriolis = np.triu(np.outer(self.length, gravity), 1)  # Eq. 2, a_ij = l_i μ_j for i < j
        return Lumps(gravity, coriolis + coriolis.T)

    @cached_property
    def inertia_lumps(self) -> Array:
        """d_i, the diagonal of the mass matrix in absolute angles (nlink), in kg m².  Eq. 3."""
        return self.inertia + self.mass * self.com**2 + self.length**2 * self.outboard_mass

    def mass_matrix(self, angles: Array) -> Array:
        """M(φ) at absolute `angles` (... x nlink) → (... x nlink x nlink), in kg m².  Eq. 4."""
        return mass_matrix(self.lumps, self.inertia_lumps, angles)


@dataclass(frozen=True)
class Lumps:
    """What is searched: `gravity` μ (nlink), in kg m, and `coriolis` a (nlink x nlink, symmetric, zero diagonal), in
    kg m².
    """

    gravity: Array
    coriolis: Array

    @property
    def nlink(self) -> int:
        return len(self.gravity)

    def __getitem__(self, candidate: int | None) -> Lumps:
        """One of many candidates, whose lumps have a leading axis; or, with None, this one as the only one of many."""
        return Lumps(self.gravity[candidate], self.coriolis[candidate])

    @cached_property
    def vector(self) -> Array:
        """All lumps in the order of `lump_names` (nlink (nlink + 1) / 2)."""
        return np.concatenate([self.gravity, self.coriolis[_pairs(self.nlink)]])

    def scaled(self, factors: Array) -> Lumps:
        """The candidate whose lumps are `factors` (nlump) times these: candidate = factor × nominal.

        Many candidates at once from `factors` (... x nlump): their lumps have the leading axes too.
        """
        n = self.nlink
        vector = self.vector * factors
        coriolis = np.zeros((*vector.shape[:-1], n, n))
        coriolis[..., *_pairs(n)] = vector[..., n:]
        return Lumps(vector[..., :n], coriolis + coriolis.swapaxes(-1, -2))


@cache
def _pairs(nlink: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The links i < j of every Coriolis lump, in the order of `lump_names`: (nlump - nlink) each."""
    first, second = np.triu_indices(nlink, 1)
    return first, second


def mass_matrix(lumps: Lumps, inertia_lumps: Array, angles: Array) -> Array:
    """M(φ) (... x nlink x nlink), in kg m², at absolute `angles` (... x nlink), from `lumps` and d (nlink).  Eq. 4."""
    difference = angles[..., :, None] - angles[..., None, :]
    matrix: Array = lumps.coriolis * np.cos(difference) + np.diag(inertia_lumps)
    return matrix


def lump_names(nlink: int) -> list[str]:
    """`gravity_1` … `gravity_n`, then `coriolis_1_2`, `coriolis_1_3` … : the parameters of a study."""
    links = range(1, nlink + 1)
    return [f"gravity_{i}" for i in links] + [f"coriolis_{i}_{j}" for i in links for j in links if i < j]


def lump_unit(name: str) -> str:
    """The SI unit of a lump, by its name."""
    return "kg m" if name.startswith("gravity") else "kg m²"


def factors_from_names(named: dict[str, float], nlink: int, default: float = 1.0) -> Array:
    """Factors by lump name → (nlump), `default` for those that are not named.  Raises EpisodeError on an unknown
    name.
    """
    names = lump_names(nlink)
    for name in named:
        if name not in names:
            raise EpisodeError(unknown("lump", name, names))
    return np.array([named.get(name, default) for name in names])


def compensation_basis(angles: Array, speeds: Array, gravity: float) -> Array:
    """Generalised force per unit of each lump, in absolute angles (... x nlink x nlump).  Eq. 5 is this times the
    lumps.

    `angles` (... x nlink) in rad and `speeds` (... x nlink) in rad/s are absolute; `gravity` in m/s².
    """
    n = angles.shape[-1]
    first, second = np.triu_indices(n, 1)
    basis = np.zeros((*angles.shape, n + len(first)))
    links = np.arange(n)
    basis[..., links, links] = -gravity * np.sin(angles)
    sine = np.sin(angles[..., first] - angles[..., second])
    pairs = n + np.arange(len(first))
    basis[..., first, pairs] = sine * speeds[..., second] ** 2
    basis[..., second, pairs] = -sine * speeds[..., first] ** 2
    return basis


def compensation_torque(lumps: Lumps, joint_angles: Array, joint_speeds: Array, gravity: float) -> Array:
    """The joint torque (nlink), in N m, that would cancel gravity and Coriolis forces if the plant had these `lumps`.

    `joint_angles` in rad, `joint_speeds` in rad/s, both (nlink); `gravity` in m/s².  Eqs. 5 and 6; Eq. 11 of the
    paper with u = 0.
    """
    angles, speeds = np.cumsum(joint_angles), np.cumsum(joint_speeds)
    sine = np.sin(angles[:, None] - angles[None, :])
    force = (lumps.coriolis * sine) @ speeds**2 - gravity * lumps.gravity * np.sin(angles)  # Eq. 5
    return np.cumsum(force[::-1])[::-1]  # Eq. 6


def speeds_after(chain: Chain, impulses: Array) -> Array:
    """Absolute link speeds (nlink), in rad/s, of a chain pushed from rest upright by `impulses` (nlink), in N s, at
    its link tips.

    An impulse at the tip of link k turns every link i ≤ k with lever l_i: M ω = l_i Σ_{k≥i} J_k.  Eq. 7.
    """
    momentum = chain.length * np.cumsum(impulses[::-1])[::-1]
    upright = chain.mass_matrix(np.zeros(chain.nlink))
    return np.asarray(np.linalg.solve(upright, momentum), dtype=np.float64)
