"""An arm by its base parameters, on the face that all models have."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from metaid.models.lumps import Array
from metaid.models.tree.arm_prior import ArmPrior
from metaid.models.tree.regressor import torque_regressor


@dataclass(frozen=True)
class TreeModel:
    """An arm with these base `parameters` (nbase); of the others it has the most probable by a `prior`."""

    prior: ArmPrior
    parameters: Array

    @property
    def names(self) -> list[str]:
        return list(self.prior.base.names)

    @property
    def units(self) -> list[str]:
        return list(self.prior.base.units)

    @property
    def expressions(self) -> list[str]:
        """What each base parameter is made of (nbase)."""
        return list(self.prior.base.expressions)

    def with_parameters(self, parameters: Array) -> TreeModel:
        return replace(self, parameters=parameters)

    def torque(self, angles: Array, speeds: Array, accelerations: Array | None = None) -> Array:
        """The joint torque (njoint) that would leave the plant these `accelerations` (njoint), none by default."""
        torque: Array = self.regressor(angles, speeds, accelerations) @ self.parameters
        return torque

    def regressor(self, angles: Array, speeds: Array, accelerations: Array | None = None) -> Array:
        """The joint torque for a unit of each base parameter (njoint x nbase)."""
        wanted = np.zeros_like(speeds) if accelerations is None else accelerations
        every = torque_regressor(self.prior.nominal, angles, speeds, wanted)
        return every.reshape(*every.shape[:-2], -1)[..., self.prior.base.columns]

    def mass_matrix(self, angles: Array) -> Array:
        still = np.zeros((len(angles), len(angles)))
        where = np.broadcast_to(angles, still.shape)
        columns = self.torque(where, still, np.eye(len(angles))) - self.torque(where, still)
        return np.asarray(columns.T, dtype=np.float64)
