"""What torque moves an arm, linear in its parameters.

Link by link from the base, then back. All vectors of a link are in its own frame. Equation numbers are those of
docs/method.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.models.law import sliding
from metaid.models.lumps import Array
from metaid.models.tree.tree import PARAMETERS, Tree

BODY = 10  # of PARAMETERS, those of the link itself; the others are its joint's
CACHED = 8_000  # states whose vectors stay in a processor's cache, of which each takes less time then


def torque_regressor(tree: Tree, coordinates: Array, speeds: Array, accelerations: Array) -> Array:
    """The joint torque for a unit of each parameter (... x njoint x njoint x 13).  Eqs. 49 to 51.

    Args:
        tree: where the joints are; its parameters have no influence.
        coordinates: of the joints (... x njoint), in rad or m.
        speeds: of the joints (... x njoint), in rad/s or m/s.
        accelerations: that the torque gives them (... x njoint), in rad/s² or m/s².
    """
    n = tree.njoint
    every = torque_columns(tree, np.arange(n * len(PARAMETERS)), coordinates, speeds, accelerations)
    return every.reshape(*every.shape[:-1], n, len(PARAMETERS))


def torque_columns(
    tree: Tree, columns: NDArray[np.intp], coordinates: Array, speeds: Array, accelerations: Array
) -> Array:
    """The same for some of the parameters of all joints alone (... x njoint x ncolumn).

    Args:
        tree: where the joints are; its parameters have no influence.
        columns: which of these they are (ncolumn), of 13 njoint.
        coordinates: of the joints (... x njoint), in rad or m.
        speeds: of the joints (... x njoint), in rad/s or m/s.
        accelerations: that the torque gives them (... x njoint), in rad/s² or m/s².
    """
    lead = coordinates.shape[:-1]
    found = np.zeros((*coordinates.shape, len(columns)))
    links, parameters = np.divmod(columns, len(PARAMETERS))
    axes = origins = np.zeros((3, 0, *lead))  # of the joints up to the link's own, in its frame
    for i, link in enumerate(_moving(tree, coordinates, speeds, accelerations)):
        axis = np.broadcast_to(tree.axis[i].reshape(3, 1, *[1] * len(lead)), (3, 1, *lead))
        axes = np.concatenate([_inwards(link.axes, axes), axis], axis=1)
        origins = _inwards(link.axes, origins - link.place[:, None])
        origins = np.concatenate([origins, np.zeros((3, 1, *lead))], axis=1)
        # A hinge turns the link, and moves its origin on a circle; a slide moves it.
        slides = tree.slides[: i + 1].reshape(i + 1, *[1] * len(lead))
        twists = np.concatenate([np.where(slides, 0.0, axes), np.where(slides, axes, -_cross(axes, origins))])
        of_body = np.flatnonzero((links == i) & (parameters < BODY))
        torque = np.einsum("kj...,kp...->jp...", twists, _of_body(link)[:, parameters[of_body]])  # Eq. 51
        found[..., : i + 1, of_body] = np.moveaxis(torque, (0, 1), (-2, -1))
        of_joint = accelerations[..., i], speeds[..., i], sliding(speeds[..., i])
        for column in np.flatnonzero((links == i) & (parameters >= BODY)):
            found[..., i, column] = of_joint[parameters[column] - BODY]
    return found


def rigid_torque(tree: Tree, parameters: Array, coordinates: Array, speeds: Array, accelerations: Array) -> Array:
    """The torque (... x njoint), in N m or N, that bodies and rotors need, without friction.  Eqs. 49 to 51, by the
    recursion of Newton and Euler, which costs much less than the regressor.

    Args:
        tree: where the joints are.
        parameters: of these (njoint x 13, or ... x njoint x 13), which need not be those of bodies that can be.
        coordinates: of the joints (... x njoint), in rad or m.
        speeds: of the joints (... x njoint), in rad/s or m/s.
        accelerations: of the joints (... x njoint), in rad/s² or m/s².
    """
    if parameters.ndim == 2 and coordinates.size > CACHED * tree.njoint:
        every = [each.reshape(-1, tree.njoint) for each in np.broadcast_arrays(coordinates, speeds, accelerations)]
        chunks = zip(*(np.array_split(each, -(-len(each) // CACHED)) for each in every), strict=True)
        return np.concatenate([rigid_torque(tree, parameters, *each) for each in chunks]).reshape(coordinates.shape)
    torque = np.broadcast_to(parameters[..., BODY] * accelerations, coordinates.shape).copy()
    links = list(_moving(tree, coordinates, speeds, accelerations))
    bodies = np.moveaxis(parameters, (-2, -1), (0, 1))
    bodies = bodies.reshape(*bodies.shape, *[1] * (coordinates.ndim + 1 - bodies.ndim))
    force = moment = np.zeros((3, *torque.shape[:-1]))
    for i, (link, own) in reversed(list(enumerate(zip(links, bodies, strict=True)))):
        first, spun = own[1:4], _product(own[4:BODY], link.spin)
        turning = _cross(link.spin_rate, first) + _cross(link.spin, _cross(link.spin, first))
        force = force + own[0] * link.rate + turning  # Eq. 50
        moment = moment + _product(own[4:BODY], link.spin_rate) + _cross(link.spin, spun) + _cross(first, link.rate)
        torque[..., i] += np.tensordot(tree.axis[i], force if tree.slides[i] else moment, 1)  # Eq. 51
        force, moment = _outwards(link.axes, force), _outwards(link.axes, moment)
        moment = moment + _cross(link.place, force)
    return torque


class _Link(NamedTuple):
    """How a link moves, in its own frame: `spin` in rad/s, its rate in rad/s², and the `rate` in m/s² at which the
    speed of its origin changes, less gravity (3 x ... each). In the frame of the link before: its `axes` (3 x 3 x ...),
    and the `place` of its origin in m (3 x ...).
    """

    axes: Array
    place: Array
    spin: Array
    spin_rate: Array
    rate: Array


def _moving(tree: Tree, coordinates: Array, speeds: Array, accelerations: Array) -> Iterator[_Link]:
    """Each link, from the base on.  Eq. 49."""
    lead = coordinates.shape[:-1]
    spin = spin_rate = np.zeros((3, *lead))
    rate = np.broadcast_to(-tree.gravity.reshape(3, *[1] * len(lead)), spin.shape)
    for i in range(tree.njoint):
        axis = tree.axis[i].reshape(3, *[1] * len(lead))
        axes, place = _placed(tree, i, coordinates[..., i])
        rate = rate + _cross(spin_rate, place) + _cross(spin, _cross(spin, place))  # Eq. 49
        spin, spin_rate, rate = _inwards(axes, np.stack([spin, spin_rate, rate], axis=1)).swapaxes(0, 1)
        turning, faster = speeds[..., i] * axis, accelerations[..., i] * axis
        if tree.slides[i]:
            rate = rate + faster + 2.0 * _cross(spin, turning)
        else:
            spin_rate = spin_rate + faster + _cross(spin, turning)
            spin = spin + turning
        yield _Link(axes, place, spin, spin_rate, rate)


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
    momenta = rigid_torque(weightless, tree.parameters, coordinates, rest, speeds)  # M v
    return np.asarray((speeds * momenta).sum(axis=-1), dtype=np.float64)


def _placed(tree: Tree, joint: int, coordinate: Array) -> tuple[Array, Array]:
    """A link's axes (3 x 3 x ...) and its origin (3 x ...) in the frame of the link before, at a `coordinate` (...)."""
    place = tree.position[joint].reshape(3, *[1] * coordinate.ndim)
    if tree.slides[joint]:
        place = place + np.multiply.outer(tree.rotation[joint] @ tree.axis[joint], coordinate)
    factors = np.stack([np.ones_like(coordinate), np.cos(coordinate), np.sin(coordinate)])
    axes = tree.axes_terms[joint].reshape(3, 9).T @ factors.reshape(3, -1)
    return axes.reshape(3, 3, *coordinate.shape), place


def _inwards(axes: Array, vectors: Array) -> Array:
    """Vectors (3 x ..., or 3 x count x ...) of the frame of the link before, in that of a link with these axes (3 x 3 x
    ...).
    """
    return _outwards(axes.swapaxes(0, 1), vectors)


def _outwards(axes: Array, vectors: Array) -> Array:
    """The other way."""
    terms = "ij...,jk...->ik..." if vectors.ndim == axes.ndim else "ij...,j...->i..."
    return np.asarray(np.einsum(terms, axes, vectors), dtype=np.float64)


def _of_body(link: _Link) -> Array:
    """Moment about the origin of a link's frame, and force (6 x 10 x ...) for a unit of each parameter of its body.
    Eq. 50.
    """
    wrench = np.zeros((6, BODY, *link.rate.shape[1:]))
    moment, force = wrench[:3], wrench[3:]
    (x, y, z), faster, rate = link.spin, link.spin_rate, link.rate
    u, v, w = faster
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    force[:, 0] = rate
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):  # c × v̇ and ω̇ × c of the first moments c
        moment[i, 1 + k], moment[j, 1 + k] = -rate[j], rate[i]
        force[i, 1 + k], force[j, 1 + k] = faster[j], -faster[i]
    force[:, 1:4] += ((-yy - zz, xy, xz), (xy, -xx - zz, yz), (xz, yz, -xx - yy))  # ω × (ω × c)
    moment[:, 4:] = (  # I ω̇ + ω × I ω of the moments of inertia
        (u, v - xz, w + xy, -yz, yy - zz, yz),
        (xz, u + yz, zz - xx, v, w - xy, -xz),
        (-xy, xx - yy, u - yz, xy, v + xz, w),
    )
    return wrench


def _product(moments: Array, vectors: Array) -> Array:
    """A matrix of inertia, of which there are six moments (6 x ...), times vectors (3 x ...)."""
    (xx, xy, xz, yy, yz, zz), (x, y, z) = moments, vectors
    product = np.empty(np.broadcast(xx, vectors).shape)
    product[0], product[1] = xx * x + xy * y + xz * z, xy * x + yy * y + yz * z
    product[2] = xz * x + yz * y + zz * z
    return product


def _cross(a: Array, b: Array) -> Array:
    """a x b (3 x ...): a component of all vectors stands together, and takes a fraction of numpy's time."""
    (a1, a2, a3), (b1, b2, b3) = a, b
    product = np.empty(np.broadcast(a, b).shape)
    np.subtract(a2 * b3, a3 * b2, out=product[0, ...])
    np.subtract(a3 * b1, a1 * b3, out=product[1, ...])
    np.subtract(a1 * b2, a2 * b1, out=product[2, ...])
    return product
