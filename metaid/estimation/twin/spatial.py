"""The twin of an arm, which moves in the coordinates of its joints."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.trials import NOTHING_FURTHER, Further, Joints, ReadTrial, WatchedTrial
from metaid.estimation.twin.shown import Shown
from metaid.estimation.twin.spatial_motion import (
    COULOMB,
    SpatialBalance,
    SpatialDerivatives,
    SpatialSpace,
    spatial_balance,
    spatial_derivatives,
    spatial_space,
)
from metaid.estimation.twin.twin import Twin
from metaid.models import Array
from metaid.models.tree import Tree, torque_regressor

SOFTNESS = (1.0 - 0.9) / 0.9  # of the constraint in units of 1/M, with the least of the usual solimp, 0.9


class SpatialTwin(Twin):
    """An arm whose unknowns are `BaseUnknowns`. It is differentiated by its base parameters, each of which is a
    parameter that the torque is linear in.
    """

    @cached_property
    def parameters(self) -> Array:
        """Of the arm (njoint x 13)."""
        parameters: Array = self.unknowns.parameters(self.point)
        return parameters

    @property
    def links(self) -> Array:
        return np.eye(self.unknowns.njoint)

    def by_unknowns(self, slopes: Array) -> Array:
        return np.asarray(slopes @ self.unknowns.root) if slopes.shape[-1] else slopes

    def watch(self, trial: WatchedTrial, windows: int, energies: bool = False) -> Shown:
        if energies:
            raise ValueError("the twin of an arm shows no energies")
        return super().watch(trial, windows)

    def moving(
        self, trial: WatchedTrial | ReadTrial, joints: Joints | None = None, further: Further = NOTHING_FURTHER
    ) -> tuple[SpatialBalance, SpatialDerivatives]:
        dry = self.parameters[:, COULOMB] + (0.0 if joints is None else joints.dry)
        sticks = bool(dry.any()) and not trial.is_continuous
        softness = self._softness[0] if sticks else None
        own = self.unknowns.frames, self.parameters, trial.law
        balance = spatial_balance(*own, softness, joints, trial.is_continuous)
        slopes = self._softness[1] if sticks and len(self._columns) else np.empty((0, 0))
        return balance, spatial_derivatives(self._columns, slopes, further, self.unknowns.njoint)

    @cached_property
    def _columns(self) -> NDArray[np.intp]:
        """Which parameters the motion is differentiated by (nunknown), among all of them."""
        columns: NDArray[np.intp] = self.unknowns.prior.base.columns
        return columns if len(self.point) else columns[:0]

    @cached_property
    def _softness(self) -> tuple[Array, Array]:
        """Of dry friction (njoint), 1/D, and its derivatives by the parameters (njoint x nunknown); NaN where there is
        no mass matrix at q = 0.
        """
        tree = self.unknowns.moved or self.unknowns.prior.nominal
        n = tree.njoint
        matrix = _rows_at_zero(tree, np.eye(n)) @ self.parameters.ravel()
        is_one = bool(np.linalg.eigvalsh(matrix).min() > 0.0)
        inverse = np.asarray(np.linalg.inv(matrix) if is_one else np.full((n, n), np.nan), dtype=np.float64)
        rows = _rows_at_zero(tree, inverse)[..., self._columns]
        return SOFTNESS * np.diag(inverse), np.ascontiguousarray(-SOFTNESS * np.einsum("ij,ijp->ip", inverse, rows))

    @property
    def space(self) -> tuple[NDArray[np.int64], SpatialSpace]:
        return spatial_space(self.unknowns.njoint)


def _rows_at_zero(tree: Tree, accelerations: Array) -> Array:
    """The rows of torques (ncase x njoint x 13 njoint) of an arm at q = 0 that only these `accelerations` (ncase x
    njoint) move.
    """
    bare, still = replace(tree, gravity=np.zeros(3)), np.zeros_like(accelerations)
    rows = torque_regressor(bare, still, still, accelerations)
    return np.asarray(rows.reshape(*accelerations.shape, -1), dtype=np.float64)
