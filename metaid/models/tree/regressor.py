"""What torque moves an arm, linear in its parameters.

Link by link from the base, then back. All vectors of a link are in its own frame. Equation numbers are those of
docs/method.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from metaid.models.law import sliding
from metaid.models.lumps import Array
from metaid.models.tree.tree import PARAMETERS, Tree

BODY = 10  # of PARAMETERS, those of the link itself; the others are its joint's
_SKEW = np.zeros((3, 3, 3))  # (a x b)_i = _SKEW[i, j, k] a_j b_k
_SKEW[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
_SKEW[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = -1.0
MOMENTS = np.zeros((3, 3, 6))  # the matrix of inertia from its six moments
for _row, _column, _moment in ((0, 0, 0), (0, 1, 1), (0, 2, 2), (1, 1, 3), (1, 2, 4), (2, 2, 5)):
    MOMENTS[_row, _column, _moment] = MOMENTS[_column, _row, _moment] = 1.0


def torque_regressor(tree: Tree, coordinates: Array, speeds: Array, accelerations: Array) -> Array:
    """The joint torque for a unit of each parameter (... x njoint x njoint x 13).  Eqs. 49 to 51.

    Args:
        tree: where the joints are; its parameters have no influence.
        coordinates: of the joints (... x njoint), in rad or m.
        speeds: of the joints (... x njoint), in rad/s or m/s.
        accelerations: that the torque gives them (... x njoint), in rad/s² or m/s².
    """
    n = tree.njoint
    regressor = np.zeros((*coordinates.shape, n, len(PARAMETERS)))
    for i, (wrench, twists) in enumerate(_links(tree, coordinates, speeds, accelerations)):
        regressor[..., : i + 1, i, :BODY] = twists @ wrench  # Eq. 51
        friction = accelerations[..., i], speeds[..., i], sliding(speeds[..., i])
        for parameter, each in enumerate(friction, start=BODY):
            regressor[..., i, i, parameter] = each
    return regressor


def body_torque(tree: Tree, parameters: Array, coordinates: Array, speeds: Array, accelerations: Array) -> Array:
    """The torque (... x njoint), in N m or N, that bodies need by themselves, without rotors and friction.  Eqs. 49 to
    51, by the recursion of Newton and Euler, which costs much less than the regressor.

    Args:
        tree: where the joints are.
        parameters: of the bodies (njoint x 13), which need not be those of bodies that can be.
        coordinates: of the joints (... x njoint), in rad or m.
        speeds: of the joints (... x njoint), in rad/s or m/s.
        accelerations: of the joints (... x njoint), in rad/s² or m/s².
    """
    torque = np.empty(coordinates.shape)
    force = moment = np.zeros(3)
    links = list(_moving(tree, coordinates, speeds, accelerations))
    for i, (link, own) in reversed(list(enumerate(zip(links, parameters, strict=True)))):
        first, inertia = own[1:4], MOMENTS @ own[4:BODY]
        turning = _cross(link.spin_rate, first) + _cross(link.spin, _cross(link.spin, first))
        force = force + own[0] * link.rate + turning  # Eq. 50
        moment = moment + link.spin_rate @ inertia + _cross(link.spin, link.spin @ inertia)
        moment = moment + _cross(first, link.rate)
        torque[..., i] = (force if tree.slides[i] else moment) @ tree.axis[i]  # Eq. 51
        force, moment = (np.einsum("...jk,...k->...j", link.matrix, each) for each in (force, moment))
        moment = moment + _cross(link.place, force)
    return torque


class _Link(NamedTuple):
    """How a link moves, in its own frame: `spin` in rad/s, its rate in rad/s², and the `rate` in m/s² at which the
    speed of its origin changes, less gravity (... x 3 each). In the frame of the link before: the `matrix` of its axes
    (... x 3 x 3), and the `place` of its origin in m (... x 3).
    """

    matrix: Array
    place: Array
    spin: Array
    spin_rate: Array
    rate: Array


def _moving(tree: Tree, coordinates: Array, speeds: Array, accelerations: Array) -> Iterator[_Link]:
    """Each link, from the base on.  Eq. 49."""
    spin = spin_rate = np.zeros((*coordinates.shape[:-1], 3))
    rate = np.broadcast_to(-tree.gravity, spin.shape)
    for i in range(tree.njoint):
        axis = tree.axis[i]
        matrix, place = _placed(tree, i, coordinates[..., i, None])
        rate = rate + _cross(spin_rate, place) + _cross(spin, _cross(spin, place))  # Eq. 49
        spin, spin_rate, rate = (np.einsum("...j,...jk->...k", each, matrix) for each in (spin, spin_rate, rate))
        turning, faster = speeds[..., i, None] * axis, accelerations[..., i, None] * axis
        if tree.slides[i]:
            rate = rate + faster + 2.0 * _cross(spin, turning)
        else:
            spin_rate = spin_rate + faster + _cross(spin, turning)
            spin = spin + turning
        yield _Link(matrix, place, spin, spin_rate, rate)


def _links(tree: Tree, coordinates: Array, speeds: Array, accelerations: Array) -> Iterator[tuple[Array, Array]]:
    """Of each link, from the base on, in the frame of the base: moment and force for a unit of each parameter of its
    body (... x 6 x 10), and the twist of the link for a unit speed of each joint up to its own (... x i + 1 x 6), which
    they do their work on.
    """
    origin = np.zeros((*coordinates.shape[:-1], 3))
    turned = np.broadcast_to(np.eye(3), (*origin.shape, 3))
    axes, origins = np.zeros((2, *origin.shape[:-1], tree.njoint, 3))
    for i, link in enumerate(_moving(tree, coordinates, speeds, accelerations)):
        origin, turned = origin + (turned @ link.place[..., None])[..., 0], turned @ link.matrix
        axes[..., i, :], origins[..., i, :] = turned @ tree.axis[i], origin
        force, moment = _of_body(link.spin, link.spin_rate, link.rate)
        yield np.concatenate([turned @ moment, turned @ force], axis=-2), _twists(tree, axes, origins, i)


def _twists(tree: Tree, axes: Array, origins: Array, link: int) -> Array:
    """How a link turns and moves for a unit speed of each joint up to its own (... x link + 1 x 6), by the `axes` and
    `origins` of all joints (... x njoint x 3), in the frame of the base.
    """
    known = slice(0, link + 1)
    axis, slides = axes[..., known, :], tree.slides[known, None]
    moving = _cross(axis, origins[..., link, None, :] - origins[..., known, :])
    return np.concatenate([np.where(slides, 0.0, axis), np.where(slides, axis, moving)], axis=-1)


def joint_torque(tree: Tree, coordinates: Array, speeds: Array, accelerations: Array) -> Array:
    """The torque (... x njoint), in N m or N, that gives the joints these accelerations.  Eq. 52.

    Args:
        tree: the arm.
        coordinates: of the joints (... x njoint), in rad or m.
        speeds: of the joints (... x njoint), in rad/s or m/s.
        accelerations: of the joints (... x njoint), in rad/s² or m/s².
    """
    regressor = torque_regressor(tree, coordinates, speeds, accelerations)
    torque: Array = np.einsum("...ijp,jp->...i", regressor, tree.parameters)
    return torque


def kinetic_squares(tree: Tree, coordinates: Array, speeds: Array) -> Array:
    """vᵀ M v (...), twice the kinetic energy, rotors' too, at `coordinates` and `speeds` v (... x njoint each)."""
    weightless, rest = replace(tree, gravity=np.zeros(3)), np.zeros_like(speeds)
    bodies = body_torque(weightless, tree.parameters, coordinates, rest, speeds)  # M v, but for rotors
    return np.asarray((speeds * (bodies + tree.rotor * speeds)).sum(axis=-1), dtype=np.float64)


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
    parts = rotation @ np.stack([along, np.eye(3) - along, across])
    shares = np.concatenate([np.ones_like(coordinate), np.cos(coordinate), np.sin(coordinate)], axis=-1)
    return (shares @ parts.reshape(3, 9)).reshape(*coordinate.shape[:-1], 3, 3), position


def _of_body(spin: Array, spin_rate: Array, rate: Array) -> tuple[Array, Array]:
    """Force and moment about the origin of the frame (... x 3 x 10 each) for a unit of each parameter of a link that
    turns with `spin`, in rad/s, changing by `spin_rate`, in rad/s², while its origin accelerates by `rate`, in m/s²,
    each (... x 3).  Eq. 50.
    """
    turning, faster, forward = (_tensor(each, _SKEW) for each in (spin, spin_rate, rate))
    of_spin, of_rate = (_tensor(each, MOMENTS) for each in (spin, spin_rate))
    none = np.zeros_like(turning)
    force = np.concatenate([rate[..., None], faster + turning @ turning, none, none], axis=-1)
    moment = np.concatenate([none[..., :1], -forward, of_rate + turning @ of_spin], axis=-1)
    return force, moment


def _tensor(vector: Array, tensor: Array) -> Array:
    """Σ_j T_ijk v_j (... x 3 x k) of vectors v (... x 3) and a tensor T (3 x 3 x k)."""
    flat = vector @ tensor.swapaxes(0, 1).reshape(3, -1)
    return flat.reshape(*vector.shape[:-1], 3, tensor.shape[-1])


def _cross(a: Array, b: Array) -> Array:
    """a x b (... x 3), to the bit as numpy has it, in a third of its time of one vector and a fifth of many."""
    product = np.empty(np.broadcast(a, b).shape)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        product[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return product
