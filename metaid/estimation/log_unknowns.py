"""What is unknown of a chain: the logarithms of its parameters as factors of the nominal ones (Eq. 24); its estimate.

A Coriolis lump is a length times a gravity lump, a_ij = l_i μ_j (Eq. 2). So n links have n gravity lumps, n inertia
lumps and n − 1 lengths, and the logarithm of every lump is linear in theirs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from metaid.estimation.descent import NOTHING
from metaid.estimation.estimate import Found
from metaid.models import COARSEST, DEVIATIONS, Array, Lumps, coriolis_of, half_width, kind_of, lump_names, mass_matrix
from metaid.models.tree import MISPLACED

POSES = 64  # at which a mass matrix is looked at
FULL = ("gravity", "coriolis", "inertia")  # the full dynamics of a chain without friction


class Columns(NamedTuple):
    """Where the unknowns of each kind begin in the vector of all unknowns, one a link; −1 for what is known.

    `coriolis` is where the gravity lumps begin that the Coriolis lumps grow with; −1 where these are known.
    """

    gravity: int
    length: int
    inertia: int
    damping: int
    coulomb: int
    coriolis: int


@dataclass(frozen=True)
class LogUnknowns:
    """The log factors z (nunknown) of the parameters that lumps of some `kinds` follow from: a parameter is its nominal
    value times e^z. Those of the Coriolis lumps are the gravity lumps and the lengths l_1 … l_{n−1}.

    `gravity` is in m/s². With exact `lengths` l (nlink), in m, these are not among the unknowns. Lumps of other kinds
    are known to be as the nominal has them. `spread` is the standard deviation of what the nominal may be wrong by, as
    a log factor.

    Raises ValueError where a nominal lump that is searched is not above 0, for it would have no log factor.
    """

    nominal: Lumps
    gravity: float
    kinds: tuple[str, ...] = FULL
    lengths: Array | None = None
    spread: float = 0.3

    tilts: ClassVar[int] = 1  # a base turns in the plane
    builds_up: ClassVar[bool] = False
    leads_on: ClassVar[bool] = False
    ends_when_cut: ClassVar[bool] = True  # longer windows lead a chain on
    least_gain: ClassVar[float] = NOTHING  # what rounding leaves
    rounding: ClassVar[float] = 1e-9
    scale: ClassVar[float] = 1.0
    begin: ClassVar[None] = None  # a fit begins at the nominal chain

    def __post_init__(self) -> None:
        for name, value in zip(self.lump_names, self.nominal.vector_of(self.kinds), strict=True):
            if not value > 0.0:
                raise ValueError(f"nominal {name} is {value:g} (allowed: above 0 for a lump that is unknown)")

    @property
    def lump_names(self) -> list[str]:
        """Of the lumps (nlump)."""
        return lump_names(self.njoint, self.kinds)

    @property
    def njoint(self) -> int:
        return self.nominal.nlink

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(f"joint {i + 1}" for i in range(self.njoint))

    @cached_property
    def names(self) -> list[str]:
        """Of the parameter that each unknown is the log factor of (nunknown)."""
        lengths = [f"length_{link}" for link in range(1, self.njoint)] if self.lengths is None else []
        each = (lengths if kind == "coriolis" else lump_names(self.njoint, (kind,)) for kind in self.kinds)
        return [name for own in each for name in own]

    @cached_property
    def columns(self) -> Columns:
        """Where the unknowns of each kind begin."""
        first = {kind_of(name): column for column, name in reversed(list(enumerate(self.names)))}
        begins = {kind: first.get(kind, -1) for kind in ("gravity", "length", "inertia", "damping", "coulomb")}
        return Columns(**begins, coriolis=begins["gravity"] if "coriolis" in self.kinds else -1)

    @cached_property
    def design(self) -> Array:
        """How the logarithms of lumps follow from z (nlump x nunknown)."""
        place = {name: column for column, name in enumerate(self.names)}
        design = np.zeros((len(self.lump_names), len(self.names)))
        for row, name in zip(design, self.lump_names, strict=True):
            kind, *links = name.split("_")
            parts = [f"length_{links[0]}", f"gravity_{links[1]}"] if kind == "coriolis" else [name]
            row[[place[part] for part in parts if part in place]] = 1.0
        return design

    def lumps(self, log_factors: Array) -> Lumps:
        """The chain with these `log_factors` (nunknown)."""
        free = tuple(kind for kind in self.kinds if kind != "coriolis")
        is_lump = np.array([not name.startswith("length") for name in self.names], dtype=np.bool_)
        lumps = replace(self.nominal, searched=free).scaled(np.exp(log_factors[is_lump]))
        if "coriolis" not in self.kinds:
            return lumps
        lengths = self.lengths
        if lengths is None:
            lengths = np.append(lengths_of(self.nominal) * np.exp(log_factors[~is_lump]), 0.0)
        return replace(lumps, coriolis=coriolis_of(lengths, lumps.gravity), searched=self.kinds)

    def log_factors(self, lumps: Lumps) -> Array:
        """The log factors (nunknown) of `lumps`, those of a chain."""
        return np.log(parameters_of(self.names, lumps) / parameters_of(self.names, self.nominal))

    def torques(self, speed: float) -> Array:
        return np.maximum(self.gravity * self.nominal.gravity, self.inertia * speed**2)

    @property
    def inertia(self) -> Array:
        return self.nominal.of("inertia")

    def alone(self, log_factors: Array) -> LogUnknowns:
        return LogUnknowns(self.lumps(log_factors), self.gravity, ())

    def misplaced(self, log_factors: Array, step: float) -> Iterator[tuple[int, LogUnknowns, float]]:
        """The chain there with each length that is said to be exact a `step` longer; see `Unknowns`."""
        lumps = self.lumps(log_factors)
        for joint in range(0 if self.lengths is None or "coriolis" not in self.kinds else self.njoint - 1):
            lengths = self.lengths + step * np.eye(self.njoint)[joint]
            longer = replace(lumps, coriolis=coriolis_of(lengths, lumps.gravity))
            yield joint, LogUnknowns(longer, self.gravity, ()), MISPLACED

    def hides_offset(self, log_factors: Array) -> None:
        """Every offset of a chain shows: its centres of mass are on its links."""

    def nearest(self, log_factors: Array, covariance: Array) -> None:
        """Logarithms are those of lumps above 0: an estimate says itself whether a chain has such a mass matrix."""

    def estimated(self, **found: Any) -> Estimate:
        return Estimate(**found, searched=self)


def parameters_of(names: Sequence[str], lumps: Lumps) -> Array:
    """The parameters of a chain by their `names` (nparameter), in SI units, from its lumps."""
    kinds = dict.fromkeys(map(kind_of, names))
    parts = [lengths_of(lumps) if kind == "length" else lumps.of(kind) for kind in kinds]
    return np.concatenate([*parts, np.empty(0)])


def lengths_of(lumps: Lumps) -> Array:
    """The lengths (nlink − 1), in m, of the chain that has these `lumps`, a_ij = l_i μ_j: those of the neighbours j.

    Eq. 2.
    """
    return np.asarray(np.diag(lumps.coriolis, 1) / lumps.gravity[1:], dtype=np.float64)


@dataclass(frozen=True, kw_only=True)
class Estimate(Found):
    """What all trials say of a chain, whose unknowns are log factors z of its parameters; see `LogUnknowns`. Its lumps
    are a view of these.
    """

    searched: LogUnknowns

    lacks = "friction, play, torques that come late or are cut off, or wrong lengths"
    share_of = "all lumps"

    @cached_property
    def lumps(self) -> Lumps:
        """The chain's; those that were known are the nominal's."""
        return self.searched.lumps(self.unknowns)

    @property
    def parameters(self) -> Array:
        """What the unknowns are the log factors of (nunknown), in SI units."""
        return parameters_of(self.names, self.lumps)

    @property
    def to_values(self) -> Array:
        return np.asarray(self.values[:, None] * self.searched.design, dtype=np.float64)

    @property
    def values(self) -> Array:
        """The lumps that follow from the unknowns (nlump)."""
        return self.lumps.vector_of(self.searched.kinds)

    @property
    def coarsest(self) -> Array:
        return np.full(len(self.unknowns), COARSEST)

    @property
    def is_possible(self) -> bool:
        """Whether the mass matrix is positive definite, at random poses in which links are parallel."""
        lumps = self.lumps
        if lumps.inertia is None:
            return True
        poses: Array = np.pi * np.random.default_rng(0).integers(0, 2, (POSES, lumps.nlink)).astype(np.float64)
        return bool((np.linalg.eigvalsh(mass_matrix(lumps, poses)) > 0.0).all())

    def interval_with(self, deviations: Array) -> tuple[Array, Array]:
        """Eq. 27; where counts are compared the `extent`."""
        values = self.values
        if self.extent is not None:
            low, high = values * np.exp(self.extent - self.searched.design @ self.unknowns)
            return low, high
        reach = np.exp(DEVIATIONS * deviations / values)
        return values / reach, values * reach

    def half_width_with(self, covariance: Array) -> float:
        """Eq. 32. All models that count the same are within an extent at once."""
        if self.extent is not None:
            return float(np.sinh(0.5 * (self.extent[1] - self.extent[0]).max()))
        return half_width(np.sqrt(np.diag(covariance)) / self.values)

    def shares(self, true: Array | None) -> tuple[Array, Array | None]:
        return self.value_deviations / self.values, None if true is None else np.abs(self.values / true - 1.0)

    def in_words(self, changes: Array) -> str:
        moved = int(np.argmax(np.abs(changes)))
        by = 100.0 * float(np.expm1(changes[moved]))
        return f"{self.names[moved]} would be {abs(by):.2g} % {'larger' if by > 0.0 else 'smaller'}"
