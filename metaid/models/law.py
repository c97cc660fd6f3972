"""The law that compensates with a candidate's lumps, and the dynamics of the planar chain that has them.

Absolute angles φ_i are measured from the upright, joint angles are q_i = φ_i − φ_{i−1}. Equation numbers are those of
docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from metaid.models.lumps import IDEAL, Array, Lumps, link_pairs

SLIDING = 0.1  # rad/s; a joint slower than this is sent that share of its dry friction: a sign would chatter


def mass_matrix(lumps: Lumps, angles: Array) -> Array:
    """M(φ) (... x nlink x nlink), in kg m², at absolute `angles` (... x nlink).  Eq. 4."""
    difference = angles[..., :, None] - angles[..., None, :]
    matrix: Array = lumps.coriolis * np.cos(difference) + lumps.of("inertia")[..., None] * np.eye(lumps.nlink)
    return matrix


def compensation_basis(
    angles: Array, speeds: Array, gravity: float, kinds: Sequence[str] = IDEAL, accelerations: Array | None = None
) -> Array:
    """Generalised force per unit of each lump, in absolute angles (... x nlink x nlump).  Eqs. 4, 5, 12 and 13 are this
    times the lumps.

    Args:
        angles: absolute (... x nlink), in rad.
        speeds: absolute (... x nlink), in rad/s.
        gravity: in m/s².
        kinds: of the lumps, in their order.
        accelerations: absolute, that the force gives the links (... x nlink), in rad/s²; None for none.
    """
    n = angles.shape[-1]
    links = np.arange(n)
    first, second = link_pairs(n)
    parts = []
    for kind in kinds:
        part = np.zeros((*angles.shape, len(first) if kind == "coriolis" else n))
        if kind == "gravity":
            _diagonal(part)[...] = -gravity * np.sin(angles)
        elif kind == "coriolis":
            sine = np.sin(angles[..., first] - angles[..., second])
            pairs = np.arange(len(first))
            part[..., first, pairs] = sine * speeds[..., second] ** 2
            part[..., second, pairs] = -sine * speeds[..., first] ** 2
            if accelerations is not None:  # Eq. 4, the off-diagonals
                cosine = np.cos(angles[..., first] - angles[..., second])
                part[..., first, pairs] += cosine * accelerations[..., second]
                part[..., second, pairs] += cosine * accelerations[..., first]
        elif kind == "inertia":
            _diagonal(part)[...] = 0.0 if accelerations is None else accelerations
        else:  # a torque in joint i turns link i one way and link i − 1 the other
            joint_speeds = np.diff(speeds, axis=-1, prepend=0.0)
            _diagonal(part)[...] = torque = joint_speeds if kind == "damping" else sliding(joint_speeds)
            part[..., links[:-1], links[1:]] = -torque[..., 1:]
        parts.append(part)
    return np.concatenate(parts, axis=-1)


def _diagonal(matrices: Array) -> Array:
    """The diagonals (... x n) of matrices (... x n x n), to write to."""
    diagonals: Array = np.einsum("...ii->...i", matrices)
    return diagonals


def sliding(joint_speeds: Array) -> Array:
    """The sign of joint speeds (...), in rad/s, without a jump: its share of the dry friction.  Eq. 12."""
    return np.clip(joint_speeds / SLIDING, -1.0, 1.0)


def running_sum(values: Array, axis: int = -1) -> Array:
    """That of numpy along a short axis, to the bit, in a fifth of its time where there are many of them."""
    total = np.array(values)
    each = total.swapaxes(0, axis)
    for i in range(1, len(each)):
        each[i] += each[i - 1]
    return total


def _product(matrix: Array, vector: Array) -> Array:
    """Of matrices (... x n x n) and vectors (... x n)."""
    product: Array = (matrix @ vector[..., None])[..., 0]
    return product


class Trajectory(NamedTuple):
    """Joint `angles` in rad, `speeds` in rad/s and `accelerations` in rad/s² over time, each (nstep x njoint); of
    slides in m.
    """

    angles: Array
    speeds: Array
    accelerations: Array


@dataclass(frozen=True)
class ChainModel:
    """A planar chain by its `lumps`, in `gravity` (m/s²). With a `stiffness` k (1/s²) the torque leaves it q̈ = −k q.
    `rotor` (... x njoint), in kg m²: the reflected inertia of what turns with a joint, and not with a link.

    Its parameters are the lumps that are searched. Angles and speeds are those of joints (... x njoint), in rad and
    rad/s; torques (... x njoint) are in N m.
    """

    lumps: Lumps
    gravity: float
    stiffness: float = 0.0
    rotor: Array | float = 0.0

    @property
    def parameters(self) -> Array:
        return self.lumps.vector

    def torque(self, angles: Array, speeds: Array) -> Array:
        """What would leave the plant nothing but q̈ = −k q if it had these lumps.  Eqs. 5, 6, 12 and 13.

        It is Eq. 11 of the paper with u = −k q, so with u = 0 where the stiffness k is 0.
        """
        lumps, links, rates = self.lumps, running_sum(angles), running_sum(speeds)
        sine = np.sin(links[..., :, None] - links[..., None, :])
        force = _product(lumps.coriolis * sine, rates**2) - self.gravity * lumps.gravity * np.sin(links)  # Eq. 5
        if self.stiffness:
            force -= self.stiffness * _product(mass_matrix(lumps, links), links)  # Eq. 13
        torque = running_sum(force[..., ::-1])[..., ::-1]  # Eq. 6
        if lumps.damping is not None:  # Eq. 12
            torque = torque + lumps.damping * speeds
        return torque if lumps.coulomb is None else torque + lumps.coulomb * sliding(speeds)

    def regressor(self, angles: Array, speeds: Array, accelerations: Array | None = None) -> Array:
        """Eqs. 4 to 6, 12 and 13, a column for each lump, of the torque that gives the joints these `accelerations`
        (... x njoint), in rad/s²; by default those of the stiffness.
        """
        given = accelerations if accelerations is not None else -self.stiffness * angles if self.stiffness else None
        wanted = None if given is None else running_sum(given)
        basis = compensation_basis(running_sum(angles), running_sum(speeds), self.gravity, self.lumps.searched, wanted)
        return running_sum(basis[..., ::-1, :], axis=-2)[..., ::-1, :]  # Eq. 6

    def mass_matrix(self, angles: Array) -> Array:
        """Eq. 4 in joint coordinates; it needs the inertia lumps."""
        absolute = mass_matrix(self.lumps, running_sum(angles))
        carried = running_sum(running_sum(absolute[..., ::-1, ::-1]), axis=-2)
        bodies = carried[..., ::-1, ::-1]  # absolute angles are sums of joint angles
        return bodies + np.asarray(self.rotor)[..., None] * np.eye(self.lumps.nlink)

    def inverse_dynamics(self, angles: Array, speeds: Array, accelerations: Array) -> Array:
        """The joint torque (... x njoint) that gives the joints these accelerations (... x njoint), in N m."""
        return self.torque(angles, speeds) + _product(self.mass_matrix(angles), accelerations)
