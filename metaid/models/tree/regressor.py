"""What torque moves an arm, linear in its parameters.

Link by link from the base, then back. All vectors of a link are in its own frame. Equation numbers are those of
docs/method.md.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from metaid.models.law import sliding
from metaid.models.lumps import Array
from metaid.models.tree.tree import PARAMETERS, Tree

BODY = 10  # of PARAMETERS, those of the link itself; the others are its joint's
_SKEW = np.zeros((3, 3, 3))  # (a x b)_i = _SKEW[i, j, k] a_j b_k
_SKEW[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
_SKEW[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = -1.0
_MOMENTS = np.zeros((3, 3, 6))  # the matrix of inertia from its six moments
for _row, _column, _moment in ((0, 0, 0), (0, 1, 1), (0, 2, 2), (1, 1, 3), (1, 2, 4), (2, 2, 5)):
    _MOMENTS[_row, _column, _moment] = _MOMENTS[_column, _row, _moment] = 1.0


def torque_regressor(tree: Tree, coordinates: Array, speeds: Array, accelerations: Array) -> Array:
    """The joint torque for a unit of each parameter (... x njoint x njoint x 13).  Eqs. 36 to 38.

    Args:
        tree: where the joints are; its parameters have no influence.
        coordinates: of the joints (... x njoint), in rad or m.
        speeds: of the joints (... x njoint), in rad/s or m/s.
        accelerations: that the torque gives them (... x njoint), in rad/s² or m/s².
    """
    n = tree.njoint
    regressor = np.zeros((*coordinates.shape, n, len(PARAMETERS)))
    for i, (wrench, down) in enumerate(_links(tree, coordinates, speeds, accelerations)):
        for j, column in _passed_on(tree, wrench, down):
            regressor[..., j, i, :BODY] = column
        friction = accelerations[..., i], speeds[..., i], sliding(speeds[..., i])
        for parameter, each in enumerate(friction, start=BODY):
            regressor[..., i, i, parameter] = each
    return regressor


def body_torque(tree: Tree, parameters: Array, coordinates: Array, speeds: Array, accelerations: Array) -> Array:
    """The torque (... x njoint), in N m or N, that bodies need by themselves, without rotors and friction. It costs a
    third of what the regressor does.

    Args:
        tree: where the joints are.
        parameters: of the bodies (njoint x 13), which need not be those of bodies that can be.
        coordinates: of the joints (... x njoint), in rad or m.
        speeds: of the joints (... x njoint), in rad/s or m/s.
        accelerations: of the joints (... x njoint), in rad/s² or m/s².
    """
    torque = np.zeros(coordinates.shape)
    for i, ((force, moment), down) in enumerate(_links(tree, coordinates, speeds, accelerations)):
        known = parameters[i, :BODY, None]
        for j, column in _passed_on(tree, (force @ known, moment @ known), down):
            torque[..., j] += column[..., 0]
    return torque


def _links(
    tree: Tree, coordinates: Array, speeds: Array, accelerations: Array
) -> Iterator[tuple[tuple[Array, Array], list[tuple[Array, Array]]]]:
    """Of each link, from the base on, force and moment (... x 3 x 10 each) for a unit of each parameter of its body,
    and how every frame so far is turned and placed in that before it.
    """
    spin = spin_rate = np.zeros((*coordinates.shape[:-1], 3))
    rate = np.broadcast_to(-tree.gravity, spin.shape)
    down: list[tuple[Array, Array]] = []
    for i in range(tree.njoint):
        axis, own = tree.axis[i], coordinates[..., i, None]
        matrix, place = _placed(tree, i, own)
        down.append((matrix, place))
        rate = rate + np.cross(spin_rate, place) + np.cross(spin, np.cross(spin, place))  # Eq. 36
        spin, spin_rate, rate = (np.einsum("...ji,...j->...i", matrix, each) for each in (spin, spin_rate, rate))
        turning, faster = speeds[..., i, None] * axis, accelerations[..., i, None] * axis
        if tree.slides[i]:
            rate = rate + faster + 2.0 * np.cross(spin, turning)
        else:
            spin_rate = spin_rate + faster + np.cross(spin, turning)
            spin = spin + turning
        yield _of_body(spin, spin_rate, rate), down


def _passed_on(tree: Tree, wrench: tuple[Array, Array], down: list[tuple[Array, Array]]) -> Iterator[tuple[int, Array]]:
    """What the force and the moment of a link (... x 3 x ncolumn each) ask of its joint and of each before it."""
    force, moment = wrench
    for j in range(len(down) - 1, -1, -1):
        matrix, place = down[j]
        yield j, np.einsum("i,...ip->...p", tree.axis[j], force if tree.slides[j] else moment)
        force, moment = matrix @ force, matrix @ moment  # Eq. 38
        moment = moment + np.einsum("ijk,...j,...kp->...ip", _SKEW, place, force)


def joint_torque(tree: Tree, coordinates: Array, speeds: Array, accelerations: Array) -> Array:
    """The torque (... x njoint), in N m or N, that gives the joints these accelerations.  Eq. 39.

    Args:
        tree: the arm.
        coordinates: of the joints (... x njoint), in rad or m.
        speeds: of the joints (... x njoint), in rad/s or m/s.
        accelerations: of the joints (... x njoint), in rad/s² or m/s².
    """
    regressor = torque_regressor(tree, coordinates, speeds, accelerations)
    torque: Array = np.einsum("...ijp,jp->...i", regressor, tree.parameters)
    return torque


def joint_mass_matrix(tree: Tree, coordinates: Array) -> Array:
    """The mass matrix (... x njoint x njoint), in kg m² (kg m and kg where joints are slides), rotors included."""
    still = np.zeros((*coordinates.shape, tree.njoint))
    where = np.broadcast_to(coordinates[..., None, :], still.shape)
    each = np.broadcast_to(np.eye(tree.njoint), still.shape)
    rest = np.zeros_like(coordinates)
    columns = joint_torque(tree, where, still, each) - joint_torque(tree, coordinates, rest, rest)[..., None, :]
    return np.asarray(columns.swapaxes(-1, -2), dtype=np.float64)


def _placed(tree: Tree, joint: int, coordinate: Array) -> tuple[Array, Array]:
    """The axes of a link's frame (... x 3 x 3) and its origin (... x 3) in the frame of the link before."""
    axis, rotation, position = tree.axis[joint], tree.rotation[joint], tree.position[joint]
    if tree.slides[joint]:
        matrix = np.broadcast_to(rotation, (*coordinate.shape[:-1], 3, 3))
        return matrix, position + coordinate * (rotation @ axis)
    along, across = np.outer(axis, axis), np.einsum("ijk,j->ik", _SKEW, axis)
    cosine, sine = np.cos(coordinate)[..., None], np.sin(coordinate)[..., None]
    return rotation @ (along + cosine * (np.eye(3) - along) + sine * across), position


def _of_body(spin: Array, spin_rate: Array, rate: Array) -> tuple[Array, Array]:
    """Force and moment about the origin of the frame (... x 3 x 10 each) for a unit of each parameter of a link that
    turns with `spin`, in rad/s, changing by `spin_rate`, in rad/s², while its origin accelerates by `rate`, in m/s²,
    each (... x 3).  Eq. 37.
    """
    turning, faster, forward = (np.einsum("ijk,...j->...ik", _SKEW, each) for each in (spin, spin_rate, rate))
    of_spin, of_rate = (np.einsum("ijm,...j->...im", _MOMENTS, each) for each in (spin, spin_rate))
    none = np.zeros_like(turning)
    force = np.concatenate([rate[..., None], faster + turning @ turning, none, none], axis=-1)
    moment = np.concatenate([none[..., :1], -forward, of_rate + turning @ of_spin], axis=-1)
    return force, moment
