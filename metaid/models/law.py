"""The law that compensates with a candidate's lumps, and the mass matrix that they make.

Absolute angles φ_i are measured from the upright, joint angles are q_i = φ_i − φ_{i−1}. Equation numbers are those of
docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence

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


def compensation_torque(
    lumps: Lumps, joint_angles: Array, joint_speeds: Array, gravity: float, stiffness: float = 0.0
) -> Array:
    """The joint torque (... x nlink), in N m, that would leave the plant nothing but q̈ = −k q if it had these lumps.

    Eqs. 5, 6, 12 and 13. It is Eq. 11 of the paper with u = −k q, so with u = 0 where the stiffness k is 0.

    Args:
        lumps: of the law.
        joint_angles: of the plant (... x nlink), in rad.
        joint_speeds: of the plant (... x nlink), in rad/s.
        gravity: in m/s².
        stiffness: k, in 1/s².
    """
    angles, speeds = running_sum(joint_angles), running_sum(joint_speeds)
    sine = np.sin(angles[..., :, None] - angles[..., None, :])
    force = _product(lumps.coriolis * sine, speeds**2) - gravity * lumps.gravity * np.sin(angles)  # Eq. 5
    if stiffness:
        force -= stiffness * _product(mass_matrix(lumps, angles), angles)  # Eq. 13
    torque = running_sum(force[..., ::-1])[..., ::-1]  # Eq. 6
    if lumps.damping is not None:  # Eq. 12
        torque = torque + lumps.damping * joint_speeds
    return torque if lumps.coulomb is None else torque + lumps.coulomb * sliding(joint_speeds)


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
