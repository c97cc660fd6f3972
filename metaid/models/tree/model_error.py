"""How wrong an arm's model is where the truth is known, and how uncertain its torque is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models.intervals import deviations_at_once
from metaid.models.lumps import Array
from metaid.models.tree.base import NOTHING, BaseParameters, random_states
from metaid.models.tree.dynamics import joint_mass_matrix
from metaid.models.tree.regressor import rigid_torque, torque_regressor
from metaid.models.tree.tree import Tree

HELD_OUT = 2  # the seed of states that nothing else is computed from


@dataclass(frozen=True)
class ModelError:
    """Root mean square errors over random states in the joint ranges, as shares of the root mean square of what is
    right: of the gravity torque, of the Coriolis and centrifugal torque, and of the mass matrix, all joints together.
    Where gravity loads no joint, the first is a share of both torques; the second, where speeds load none, as of a
    single hinge. Where neither does, as of a balanced one, both are shares of the torque that accelerates the joints.
    """

    gravity: float
    coriolis: float
    mass_matrix: float

    @property
    def largest(self) -> float:
        return max(self.gravity, self.coriolis, self.mass_matrix)


def model_error(true: Tree, parameters: Array) -> ModelError:
    """How wrong a model with these `parameters` (njoint x 13) of the `true` arm is. Friction is no part of it."""
    return difference(true, true.with_parameters(parameters))


def difference(true: Tree, other: Tree) -> ModelError:
    """How wrong another arm with the same joints is, wherever these are."""
    coordinates, speeds, accelerations = random_states(true, HELD_OUT)
    still = np.zeros_like(speeds)
    parts: list[tuple[Array, Array, Array]] = []
    for arm in (true, other):
        gravity, bias = (rigid_torque(arm, arm.parameters, coordinates, each, still) for each in (still, speeds))
        parts.append((gravity, bias - gravity, joint_mass_matrix(arm, coordinates)))
    (gravity, coriolis, matrix), found = parts
    both, accelerating = gravity + coriolis, np.einsum("sij,sj->si", matrix, accelerations)
    return ModelError(
        _share(gravity, found[0], _loading(gravity, both, accelerating)),
        _share(coriolis, found[1], _loading(coriolis, both, accelerating)),
        _share(matrix, found[2], matrix),
    )


def torque_half_width(tree: Tree, base: BaseParameters, values: Array, covariance: Array) -> float:
    """Half the interval that holds the torque of each joint, all joints at once with 95 %, as a share of what the joint
    needs, root mean squares over random states; of the joint where that is widest.

    Args:
        tree: the arm, whose kinematics and ranges count.
        base: its base parameters.
        values: of these (nbase).
        covariance: of the `values` (nbase x nbase).
    """
    rows = torque_rows(tree, base)
    needed = ((rows @ values) ** 2).mean(axis=0)
    unsure = np.einsum("sjb,bc,sjc->j", rows, covariance, rows) / len(rows)
    return deviations_at_once(tree.njoint) * float(np.sqrt((unsure / needed).max()))


def torque_rows(tree: Tree, base: BaseParameters) -> Array:
    """What the joint torques are by the base parameters (nstate x njoint x nbase), in random states of an arm."""
    regressor = torque_regressor(tree, *random_states(tree, HELD_OUT))
    return np.asarray(regressor.reshape(*regressor.shape[:2], -1)[..., base.columns])


def _loading(*torques: Array) -> Array:
    """The first of `torques` (each nstate x njoint) that is more than rounding beside the others."""
    sizes = [float(np.abs(torque).max()) for torque in torques]
    return next(torque for torque, size in zip(torques, sizes, strict=True) if size > NOTHING * max(sizes))


def _share(right: Array, wrong: Array, whole: Array) -> float:
    """The error as a share of the `whole`."""
    return float(np.sqrt(((wrong - right) ** 2).sum() / (whole**2).sum()))
