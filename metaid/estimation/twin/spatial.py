"""The twin of an arm, which moves in the coordinates of its joints."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.compiled.spatial import new_space
from metaid.estimation.trials import Joints, ReadTrial, WatchedTrial
from metaid.estimation.twin.spatial_motion import (
    COULOMB,
    DAMPING,
    ROTOR,
    SpatialBalance,
    SpatialDerivatives,
    SpatialSpace,
)
from metaid.estimation.twin.twin import Twin
from metaid.estimation.twin.workspace import Beside
from metaid.models import Array
from metaid.models.tree import PARAMETERS, Tree, tilted_gravity, torque_regressor

SOFTNESS = (1.0 - 0.9) / 0.9  # of the constraint in units of 1/M, with the least of the usual solimp, 0.9
TILT = 1e-6  # rad, a step of a difference


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

    @property
    def space(self) -> tuple[NDArray[np.int64], SpatialSpace]:
        n = self.unknowns.njoint
        return np.full(n, -1), SpatialSpace(new_space(n), *np.zeros((2, n, n, 3)), *np.zeros((7, n)))

    def by_unknowns(self, slopes: Array) -> Array:
        return np.asarray(slopes @ self.unknowns.root) if slopes.shape[-1] else slopes

    def _leaning(self, joints: Joints) -> tuple[Array, Array, Array]:
        lean = 0.0 - joints.offset  # what reads too much is less far.  Eq. 43
        return lean, lean, joints.tilt.T

    def _moving(self, trial: WatchedTrial | ReadTrial, joints: Joints, unknown: Beside) -> tuple[Any, Any]:
        own, is_continuous, frames = self.parameters.copy(), trial.is_continuous, self.unknowns.frames
        sent = np.zeros_like(own) if trial.law is None else np.array(trial.law, order="C")
        damping, coulomb = sent[:, DAMPING] - own[:, DAMPING] - joints.viscous, sent[:, COULOMB].copy()
        dry, none = own[:, COULOMB] + joints.dry, np.zeros(len(own))
        sticks = bool(dry.any()) and not is_continuous
        own[:, ROTOR] += joints.rotor
        own[:, DAMPING:] = sent[:, DAMPING:] = 0.0
        ahead, behind = (
            np.array([tilted_gravity(frames.gravity, joints.tilt + step) for step in sign * TILT * np.eye(2)])
            for sign in (1.0, -1.0)
        )
        balance = SpatialBalance(
            frames=frames._replace(gravity=tilted_gravity(frames.gravity, joints.tilt)),
            parameters=own,
            difference=sent - own,
            law=sent[:0] if trial.law is None else sent,
            stiffness=0.0,
            sticking=none if is_continuous else dry,
            softness=self._softness[0] if sticks else np.empty(0),
            turned=(ahead - behind) / (2.0 * TILT),
            damping=damping,
            coulomb=coulomb,
            spring=0.0 - joints.spring,
            straight=np.array(joints.offset),
            dry=dry if is_continuous else none,
            presliding=float(joints.presliding[0]) if is_continuous else 0.0,
            cogging=np.array(joints.cogging),
        )
        links, kinds = np.divmod(self._columns.astype(np.int64), len(PARAMETERS))
        softness = self._softness[1] if sticks and len(links) else np.empty((0, 0))
        return balance, SpatialDerivatives(links, kinds, softness, unknown)

    @cached_property
    def _columns(self) -> NDArray[np.intp]:
        """Which parameters the motion is differentiated by (nunknown), among all of them."""
        columns: NDArray[np.intp] = self.unknowns.prior.base.columns if len(self.point) else np.empty(0, dtype=np.intp)
        return columns

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


def _rows_at_zero(tree: Tree, accelerations: Array) -> Array:
    """The rows of torques (ncase x njoint x 13 njoint) of an arm at q = 0 that only these `accelerations` (ncase x
    njoint) move.
    """
    bare, still = replace(tree, gravity=np.zeros(3)), np.zeros_like(accelerations)
    rows = torque_regressor(bare, still, still, accelerations)
    return np.asarray(rows.reshape(*accelerations.shape, -1), dtype=np.float64)
