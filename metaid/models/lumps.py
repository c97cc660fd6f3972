"""Lumped parameters of a planar chain of links: what a law is made of and what a study searches.

Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.errors import EpisodeError, unknown

Array = NDArray[np.float64]

LARGEST_FACTOR = 1000.0

UNITS = {"gravity": "kg m", "coriolis": "kg m²", "damping": "N m s", "coulomb": "N m", "inertia": "kg m²"}

IDEAL = ("gravity", "coriolis")  # kinds of lumps that a chain without friction is compensated with

FRICTION = ("damping", "coulomb")


@dataclass(frozen=True)
class Lumps:
    """What a law is made of: `gravity` μ (nlink), in kg m; `coriolis` a (nlink x nlink, symmetric, zero diagonal), in
    kg m²; and, unless they are left out, `damping` b in N m s, `coulomb` c in N m, `inertia` d in kg m², each (nlink).

    `searched`: the kinds that candidates differ in, and in this order the parts of `vector`.
    """

    gravity: Array
    coriolis: Array
    damping: Array | None = None
    coulomb: Array | None = None
    inertia: Array | None = None
    searched: tuple[str, ...] = IDEAL

    @property
    def nlink(self) -> int:
        return int(self.gravity.shape[-1])

    @property
    def njoint(self) -> int:
        """One for each link."""
        return self.nlink

    @cached_property
    def names(self) -> list[str]:
        """The names of the searched lumps (nlump)."""
        return lump_names(self.nlink, self.searched)

    def __getitem__(self, candidate: int | None) -> Lumps:
        """One of many candidates, whose lumps have a leading axis; or, with None, this one as the only one of many."""
        parts = {kind: lumps[candidate] for kind in UNITS if (lumps := getattr(self, kind)) is not None}
        return Lumps(**parts, searched=self.searched)

    @cached_property
    def vector(self) -> Array:
        """The searched lumps in the order of `names` (... x nlump)."""
        return self.vector_of(self.searched)

    def vector_of(self, kinds: Sequence[str], absent: float = 0.0) -> Array:
        """The lumps of these `kinds`, in the order of `lump_names`; `absent` for each that is left out."""
        nothing = np.empty((*self.gravity.shape[:-1], 0))
        return np.concatenate([nothing, *(self.of(kind, absent) for kind in kinds)], axis=-1)

    def of(self, kind: str, absent: float = 0.0) -> Array:
        """The lumps of one `kind`; `absent` for each where they are left out."""
        if kind == "coriolis":
            return self.coriolis[..., *link_pairs(self.nlink)]
        lumps: Array | None = getattr(self, kind)
        return np.full(self.gravity.shape, absent) if lumps is None else lumps

    def scaled(self, factors: Array) -> Lumps:
        """The candidate whose searched lumps are `factors` (... x nlump) times these: candidate = factor × nominal."""
        return self.with_parameters(self.vector * factors)

    @property
    def law(self) -> Lumps:
        """What a law is made of: these."""
        return self

    def law_of(self, factors: Array) -> Lumps:
        """The candidate with these `factors` (nlump), which anybody may have given.  Raises EpisodeError where they are
        none.
        """
        try:
            given = np.asarray(factors)
            vector = given.astype(np.float64) if given.dtype.kind in "fiub" else None
        except (TypeError, ValueError):
            vector = None
        if vector is None or vector.shape != self.vector.shape:
            raise EpisodeError(f"these are no factors (allowed: {len(self.vector)} numbers, one for each lump)")
        for factor in vector[~(np.abs(vector) <= LARGEST_FACTOR)][:1]:
            raise EpisodeError(f"a factor is {factor:g} (allowed: {-LARGEST_FACTOR:g} to {LARGEST_FACTOR:g})")
        return self.scaled(vector)

    def laws_of(self, factors: Array) -> Lumps:
        """The candidates with these `factors` (ncandidate x nlump)."""
        return self.scaled(factors)

    def with_parameters(self, vector: Array) -> Lumps:
        """The same lumps but for the searched ones, which are those of `vector` (nlump), in the order of `names`.

        Many candidates at once from a `vector` (... x nlump): all their lumps have the leading axes too.
        """
        n, first = self.nlink, 0
        axes = vector.shape[:-1]
        known = {kind: lumps for kind in UNITS if (lumps := getattr(self, kind)) is not None}
        parts = {kind: np.broadcast_to(lumps, (*axes, *lumps.shape)) for kind, lumps in known.items()}
        for kind in self.searched:
            last = first + (n * (n - 1) // 2 if kind == "coriolis" else n)
            parts[kind], first = vector[..., first:last], last
        if "coriolis" in self.searched:
            coriolis = np.zeros((*axes, n, n))
            coriolis[..., *link_pairs(n)] = parts["coriolis"]
            parts["coriolis"] = coriolis + coriolis.swapaxes(-1, -2)
        return Lumps(**parts, searched=self.searched)


def coriolis_of(lengths: Array, gravity: Array) -> Array:
    """a_ij = l_i μ_j, i < j (nlink x nlink, symmetric), in kg m², of `lengths` (nlink) in m and μ (nlink) in kg m."""
    upper = np.triu(np.outer(lengths, gravity), 1)  # Eq. 2
    return np.asarray(upper + upper.T, dtype=np.float64)


@cache
def link_pairs(nlink: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The links i < j of every Coriolis lump, in the order of `lump_names`: (nlump - nlink) each."""
    first, second = np.triu_indices(nlink, 1)
    return first, second


def lump_names(nlink: int, kinds: Sequence[str] = IDEAL) -> list[str]:
    """`gravity_1` … `gravity_n`, then `coriolis_1_2`, `coriolis_1_3` … , and so on by `kinds`: the parameters of a
    study.
    """
    links = range(1, nlink + 1)
    pairs = [f"{i}_{j}" for i in links for j in links if i < j]
    return [f"{kind}_{which}" for kind in kinds for which in (pairs if kind == "coriolis" else links)]


def kind_of(name: str) -> str:
    """The kind of a lump, or of a fault, by its name."""
    return name.partition("_")[0]


def lump_unit(name: str) -> str:
    """The SI unit of a lump, by its name."""
    return UNITS[kind_of(name)]


def factors_from_names(
    named: dict[str, float], nlink: int, default: float = 1.0, kinds: Sequence[str] = IDEAL
) -> Array:
    """Factors by lump name → (nlump).

    Args:
        named: the factors, by lump name.
        nlink: the number of links.
        default: the factor of each lump that is not named.
        kinds: of the lumps, in their order.

    Raises:
        EpisodeError: a name is no lump's.
    """
    names = lump_names(nlink, kinds)
    for name in named:
        if name not in names:
            raise EpisodeError(unknown("lump", name, names))
    return np.array([named.get(name, default) for name in names])
