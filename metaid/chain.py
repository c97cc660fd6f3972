"""A planar chain of links: its lumped parameters, and the law that compensates with them.

A chain of n links stands on its base. Link i has length l_i, mass m_i, centre of mass com_i (from its joint) and
inertia I_i (about its centre of mass). Absolute angles φ_i are measured from the upright, joint angles are q_i = φ_i
− φ_{i−1}. Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.errors import EpisodeError, unknown

Array = NDArray[np.float64]

UNITS = {"gravity": "kg m", "coriolis": "kg m²", "damping": "N m s", "coulomb": "N m", "inertia": "kg m²"}
IDEAL = ("gravity", "coriolis")  # kinds of lumps that a chain without friction is compensated with
FRICTION = ("damping", "coulomb")
SLIDING = 0.1  # rad/s; a joint slower than this is sent that share of its dry friction: a sign would chatter


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
        coriolis = np.triu(np.outer(self.length, gravity), 1)  # Eq. 2, a_ij = l_i μ_j for i < j
        friction = {kind: getattr(self, kind) for kind in FRICTION if kind in kinds}
        inertia = self.inertia_lumps
        return Lumps(gravity, coriolis + coriolis.T, **friction, inertia=inertia, searched=tuple(kinds))

    @cached_property
    def inertia_lumps(self) -> Array:
        """d_i, the diagonal of the mass matrix in absolute angles (nlink), in kg m².  Eq. 3."""
        return self.inertia + self.mass * self.com**2 + self.length**2 * self.outboard_mass

    def mass_matrix(self, angles: Array) -> Array:
        """M(φ) at absolute `angles` (... x nlink) → (... x nlink x nlink), in kg m².  Eq. 4."""
        return mass_matrix(self.lumps, self.inertia_lumps, angles)


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
        """The searched lumps in the order of `names` (nlump)."""
        return self.vector_of(self.searched)

    def vector_of(self, kinds: Sequence[str], absent: float = 0.0) -> Array:
        """The lumps of these `kinds`, in the order of `lump_names`; `absent` for each that is left out."""
        return np.concatenate([self.of(kind, absent) for kind in kinds])

    def of(self, kind: str, absent: float = 0.0) -> Array:
        """The lumps of one `kind`; `absent` for each where they are left out."""
        if kind == "coriolis":
            return self.coriolis[..., *_pairs(self.nlink)]
        lumps: Array | None = getattr(self, kind)
        return np.full(self.gravity.shape, absent) if lumps is None else lumps

    def scaled(self, factors: Array) -> Lumps:
        """The candidate whose searched lumps are `factors` (nlump) times these: candidate = factor × nominal.

        Many candidates at once from `factors` (... x nlump): all their lumps have the leading axes too.
        """
        n, vector, first = self.nlink, self.vector * factors, 0
        axes = vector.shape[:-1]
        known = {kind: lumps for kind in UNITS if (lumps := getattr(self, kind)) is not None}
        parts = {kind: np.broadcast_to(lumps, (*axes, *lumps.shape)) for kind, lumps in known.items()}
        for kind in self.searched:
            last = first + (n * (n - 1) // 2 if kind == "coriolis" else n)
            parts[kind], first = vector[..., first:last], last
        if "coriolis" in self.searched:
            coriolis = np.zeros((*axes, n, n))
            coriolis[..., *_pairs(n)] = parts["coriolis"]
            parts["coriolis"] = coriolis + coriolis.swapaxes(-1, -2)
        return Lumps(**parts, searched=self.searched)


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


def lump_names(nlink: int, kinds: Sequence[str] = IDEAL) -> list[str]:
    """`gravity_1` … `gravity_n`, then `coriolis_1_2`, `coriolis_1_3` … , and so on by `kinds`: the parameters of a
    study.
    """
    links = range(1, nlink + 1)
    pairs = [f"{i}_{j}" for i in links for j in links if i < j]
    return [f"{kind}_{which}" for kind in kinds for which in (pairs if kind == "coriolis" else links)]


def kind_of(name: str) -> str:
    """The kind of a lump, by its name."""
    return name.partition("_")[0]


def lump_unit(name: str) -> str:
    """The SI unit of a lump, by its name."""
    return UNITS[kind_of(name)]


def factors_from_names(
    named: dict[str, float], nlink: int, default: float = 1.0, kinds: Sequence[str] = IDEAL
) -> Array:
    """Factors by lump name → (nlump), `default` for those that are not named.  Raises EpisodeError on an unknown
    name.
    """
    names = lump_names(nlink, kinds)
    for name in named:
        if name not in names:
            raise EpisodeError(unknown("lump", name, names))
    return np.array([named.get(name, default) for name in names])


def compensation_basis(
    angles: Array, speeds: Array, gravity: float, kinds: Sequence[str] = IDEAL, stiffness: float = 0.0
) -> Array:
    """Generalised force per unit of each lump of these `kinds`, in absolute angles (... x nlink x nlump).  Eqs. 5, 15
    and 16 are this times the lumps.

    `angles` (... x nlink) in rad and `speeds` (... x nlink) in rad/s are absolute; `gravity` in m/s², `stiffness` in
    1/s².
    """
    n = angles.shape[-1]
    links = np.arange(n)
    first, second = np.triu_indices(n, 1)
    joint_speeds = np.diff(speeds, axis=-1, prepend=0.0)
    parts = []
    for kind in kinds:
        part = np.zeros((*angles.shape, len(first) if kind == "coriolis" else n))
        if kind == "gravity":
            part[..., links, links] = -gravity * np.sin(angles)
        elif kind == "coriolis":
            sine = np.sin(angles[..., first] - angles[..., second])
            pairs = np.arange(len(first))
            part[..., first, pairs] = sine * speeds[..., second] ** 2
            part[..., second, pairs] = -sine * speeds[..., first] ** 2
        elif kind == "inertia":
            part[..., links, links] = -stiffness * angles
        else:  # a torque in joint i turns link i one way and link i − 1 the other
            part[..., links, links] = torque = joint_speeds if kind == "damping" else sliding(joint_speeds)
            part[..., links[:-1], links[1:]] = -torque[..., 1:]
        parts.append(part)
    return np.concatenate(parts, axis=-1)


def sliding(joint_speeds: Array) -> Array:
    """The sign of joint speeds (...), in rad/s, without a jump: its share of the dry friction.  Eq. 15."""
    return np.clip(joint_speeds / SLIDING, -1.0, 1.0)


def compensation_torque(
    lumps: Lumps, joint_angles: Array, joint_speeds: Array, gravity: float, stiffness: float = 0.0
) -> Array:
    """The joint torque (nlink), in N m, that would leave the plant nothing but q̈ = −stiffness q if it had these
    `lumps`.

    `joint_angles` in rad, `joint_speeds` in rad/s, both (nlink); `gravity` in m/s², `stiffness` in 1/s².  Eqs. 5, 6,
    15 and 16; Eq. 11 of the paper, with u = 0 where `stiffness` is.
    """
    angles, speeds = np.cumsum(joint_angles), np.cumsum(joint_speeds)
    sine = np.sin(angles[:, None] - angles[None, :])
    force = (lumps.coriolis * sine) @ speeds**2 - gravity * lumps.gravity * np.sin(angles)  # Eq. 5
    if stiffness:
        force -= stiffness * mass_matrix(lumps, lumps.of("inertia"), angles) @ angles  # Eq. 16
    torque = np.cumsum(force[::-1])[::-1]  # Eq. 6
    return torque + lumps.of("damping") * joint_speeds + lumps.of("coulomb") * sliding(joint_speeds)  # Eq. 15


def speeds_after(chain: Chain, impulses: Array) -> Array:
    """Absolute link speeds (nlink), in rad/s, of a chain pushed from rest upright by `impulses` (nlink), in N s, at
    its link tips.

    An impulse at the tip of link k turns every link i ≤ k with lever l_i: M ω = l_i Σ_{k≥i} J_k.  Eq. 7.
    """
    momentum = chain.length * np.cumsum(impulses[::-1])[::-1]
    upright = chain.mass_matrix(np.zeros(chain.nlink))
    return np.asarray(np.linalg.solve(upright, momentum), dtype=np.float64)
