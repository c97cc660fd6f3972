"""A planar chain of links: its physical parameters, and the lumps that follow from them.

A chain of n links stands on its base. Link i has length l_i, mass m_i, centre of mass com_i (from its joint) and
inertia I_i (about its centre of mass). Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from metaid.models.law import mass_matrix
from metaid.models.lumps import FRICTION, IDEAL, Array, Lumps, coriolis_of


@dataclass(frozen=True)
class Chain:
    """Physical parameters of a chain, each (nlink,): `length` and `com` in m, `mass` in kg, `inertia` in kg m²,
    `damping` in N m s, dry friction `coulomb` in N m, `stiffness` in N m/rad.
    """

    length: Array
    mass: Array
    com: Array
    inertia: Array
    damping: Array
    coulomb: Array
    stiffness: Array

    @property
    def nlink(self) -> int:
        return len(self.length)

    @cached_property
    def outboard_mass(self) -> Array:
        """Σ_{k>i} m_k, the mass that link i carries at its tip (nlink), in kg."""
        return np.cumsum(self.mass[::-1])[::-1] - self.mass

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of lumps that cancel all forces on this chain: those of its friction, if it has any, included."""
        return IDEAL + tuple(kind for kind in FRICTION if getattr(self, kind).any())

    @cached_property
    def lumps(self) -> Lumps:
        """The chain's own lumps, less those of its friction."""
        return self.lumps_of(IDEAL)

    def lumps_of(self, kinds: Sequence[str]) -> Lumps:
        """The chain's own lumps, those of these `kinds` searched, and friction in the law where it is among them.
        Eqs. 1 to 3.
        """
        gravity = self.mass * self.com + self.length * self.outboard_mass  # Eq. 1
        friction = {kind: getattr(self, kind) for kind in FRICTION if kind in kinds}
        inertia = self.inertia_lumps
        return Lumps(gravity, coriolis_of(self.length, gravity), **friction, inertia=inertia, searched=tuple(kinds))

    @cached_property
    def inertia_lumps(self) -> Array:
        """d_i, the diagonal of the mass matrix in absolute angles (nlink), in kg m².  Eq. 3."""
        return self.inertia + self.mass * self.com**2 + self.length**2 * self.outboard_mass

    def mass_matrix(self, angles: Array) -> Array:
        """M(φ) at absolute `angles` (... x nlink) → (... x nlink x nlink), in kg m².  Eq. 4."""
        return mass_matrix(self.lumps, angles)


def speeds_after(chain: Chain, impulses: Array, angles: Array) -> Array:
    """Absolute link speeds (nlink), in rad/s, of a chain pushed from rest at absolute `angles` (nlink), in rad, by
    horizontal `impulses` (nlink), in N s, at its link tips.

    An impulse at the tip of link k turns every link i ≤ k with lever l_i cos φ_i.  Eq. 7.
    """
    momentum = chain.length * np.cos(angles) * np.cumsum(impulses[::-1])[::-1]
    return np.asarray(np.linalg.solve(chain.mass_matrix(angles), momentum), dtype=np.float64)
