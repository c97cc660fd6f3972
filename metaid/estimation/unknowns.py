"""What is unknown of a chain: log factors of its nominal lumps (Eq. 24)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.models import UNITS, Array, Lumps, lump_names

FULL = ("gravity", "coriolis", "inertia")  # the full dynamics of a chain without friction


@dataclass(frozen=True)
class Columns:
    """Where the unknowns of each kind of lump begin in the vector of all unknowns; −1 for lumps that are known.

    `first` (4) is of gravity, inertia, damping and coulomb lumps, one a link. The Coriolis lumps a_ij of one i and
    all j > i are neighbours; `coriolis` (nlink) is where they begin.
    """

    first: NDArray[np.int64]
    coriolis: NDArray[np.int64]


@dataclass(frozen=True)
class Unknowns:
    """The log factors z (nunknown) of the lumps of some `kinds`: a lump is its `nominal` value times e^z.

    With exact `lengths` l (nlink), in m, the Coriolis lumps follow from the gravity lumps, a_ij = l_i μ_j, and are not
    among the unknowns. Lumps of other kinds are known to be as the nominal has them. `spread` is the standard deviation
    of what the nominal may be wrong by, as a log factor.

    Raises ValueError where a nominal lump that is searched is not above 0, for it would have no log factor.
    """

    nominal: Lumps
    kinds: tuple[str, ...] = FULL
    lengths: Array | None = None
    spread: float = 0.3

    def __post_init__(self) -> None:
        for name, value in zip(self.names, self._searched, strict=True):
            if not value > 0.0:
                raise ValueError(f"nominal {name} is {value:g} (allowed: above 0 for a lump that is unknown)")

    @property
    def nlink(self) -> int:
        return self.nominal.nlink

    @cached_property
    def searched(self) -> tuple[str, ...]:
        """The kinds that unknowns of their own belong to: not the Coriolis lumps where lengths are exact."""
        return tuple(kind for kind in self.kinds if not (kind == "coriolis" and self.lengths is not None))

    @cached_property
    def names(self) -> list[str]:
        """The name of the lump that each unknown is the log factor of (nunknown)."""
        return lump_names(self.nlink, self.searched)

    @cached_property
    def _searched(self) -> Array:
        return self.nominal.vector_of(self.searched)

    @cached_property
    def columns(self) -> Columns:
        """Where the unknowns of each kind begin."""
        n, first, begins = self.nlink, 0, dict.fromkeys(UNITS, -1)
        for kind in self.searched:
            begins[kind] = first
            first += n * (n - 1) // 2 if kind == "coriolis" else n
        links = np.arange(n)
        coriolis = np.full(n, -1)
        if self.lengths is not None and begins["gravity"] >= 0:
            coriolis = begins["gravity"] + links + 1
        elif begins["coriolis"] >= 0:
            above = n - 1 - links
            coriolis = begins["coriolis"] + np.cumsum(above) - above
        return Columns(np.array([begins[kind] for kind in ("gravity", "inertia", "damping", "coulomb")]), coriolis)

    def lumps(self, log_factors: Array) -> Lumps:
        """The chain with these `log_factors` (nunknown)."""
        lumps = replace(self.nominal, searched=self.searched).scaled(np.exp(log_factors))
        if self.lengths is None:
            return lumps
        return replace(lumps, coriolis=coriolis_of(self.lengths, lumps.gravity))

    def log_factors(self, lumps: Lumps) -> Array:
        """The log factors (nunknown) of `lumps`."""
        return np.log(lumps.vector_of(self.searched) / self._searched)


def coriolis_of(lengths: Array, gravity: Array) -> Array:
    """a_ij = l_i μ_j, i < j (nlink x nlink, symmetric), in kg m², of `lengths` (nlink) in m and μ (nlink) in kg m."""
    upper = np.triu(np.outer(lengths, gravity), 1)  # Eq. 2
    return np.asarray(upper + upper.T, dtype=np.float64)


def known_alone(unknowns: Unknowns, log_factors: Array) -> Unknowns:
    """A chain with these `log_factors` (nunknown), of which nothing is unknown any more: nothing is differentiated."""
    return Unknowns(unknowns.lumps(log_factors), ())
