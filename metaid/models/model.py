"""The dynamics of a planar chain by its lumps, in joint coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from metaid.models.law import compensation_basis, compensation_torque, mass_matrix, running_sum
from metaid.models.lumps import Array, Lumps


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

    Its parameters are the lumps that are searched. Angles and speeds are those of joints (... x njoint), in rad and
    rad/s; torques (... x njoint) are in N m.
    """

    lumps: Lumps
    gravity: float
    stiffness: float = 0.0

    @property
    def parameters(self) -> Array:
        return self.lumps.vector

    def torque(self, angles: Array, speeds: Array) -> Array:
        """Eqs. 5, 6, 12 and 13."""
        return compensation_torque(self.lumps, angles, speeds, self.gravity, self.stiffness)

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
        return carried[..., ::-1, ::-1]  # absolute angles are sums of joint angles

    def inverse_dynamics(self, angles: Array, speeds: Array, accelerations: Array) -> Array:
        """The joint torque (... x njoint) that gives the joints these accelerations (... x njoint), in N m."""
        gained = np.einsum("...ij,...j->...i", self.mass_matrix(angles), accelerations)
        return np.asarray(self.torque(angles, speeds) + gained, dtype=np.float64)
