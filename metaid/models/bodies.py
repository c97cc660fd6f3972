"""Individual parameters in place of lumps: masses and centres of mass of links whose lengths are known.

Gravity lumps are linear in the masses m_i and the first moments s_i = m_i c_i (Eq. 1), and with the lengths known they
fix all Coriolis lumps (Eq. 2). So 2 nlink parameters have nlink lumps between them. The inertias I_i are in none of
these lumps and are not among the parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from metaid.models.chain import Chain
from metaid.models.lumps import Array, Lumps

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
