"""The dynamics of an arm, compiled: linear in its parameters, which need not be those of bodies that can be.

Frames, parameters and their order are those of `metaid.models.tree`. All vectors of a link are in its own frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from metaid.compiled.decorator import compiled
from metaid.compiled.spatial.vectors import (
    cosine_and_sine,
    cross,
    dot,
    inward,
    outward,
    plus,
    put,
    symmetric,
    times,
    triple,
)
from metaid.models import SLIDING, Array
from metaid.models.tree import Tree


class Frames(NamedTuple):
    """Where the joints of an arm are. The axes of a link are fixed + cos q turned + sin q across (njoint x 9 each, row
    by row), its origin is at position + q slide (njoint x 3 each); its joint's own axis (njoint x 3), and 1 for a slide
    (njoint).
    """

    fixed: Array
    turned: Array
    across: Array
    position: Array
    slide: Array
    axis: Array
    is_slide: Array
    gravity: Array


class Space(NamedTuple):
    """Working space: of each link its axes (njoint x 9) and its origin in the frame of the link before, its spin, the
    rate of that, and the acceleration of its origin less gravity (njoint x 3 each); the force and the moment that it
    takes to move it so (njoint x 3 each); what it carries (njoint x 10); the mass matrix, its lower triangle, and the
    factor of that (njoint x njoint).
    """

    matrix: Array
    place: Array
    spin: Array
    spin_rate: Array
    rate: Array
    force: Array
    moment: Array
    carried: Array
    mass_matrix: Array
    factor: Array


def frames_of(tree: Tree) -> Frames:
    """Those of an arm."""
    fixed, turned, across = np.array(tree.axes_terms.reshape(tree.njoint, 3, 9).swapaxes(0, 1), order="C")
    slide = np.einsum("nij,nj->ni", tree.rotation, tree.axis) * tree.slides[:, None]
    vectors = tree.position, tree.axis, tree.gravity
    position, axis, gravity = (np.array(each, np.float64, order="C") for each in vectors)
    return Frames(fixed, turned, across, position, slide, axis, tree.slides.astype(np.float64), gravity)


def new_space(njoint: int) -> Space:
    """Working space for an arm with so many joints."""
    place, spin, spin_rate, rate, force, moment = np.zeros((6, njoint, 3))
    of_links = np.zeros((njoint, 9)), place, spin, spin_rate, rate, force, moment, np.zeros((njoint, 10))
    return Space(*of_links, *np.zeros((2, njoint, njoint)))


@compiled
def place_link(frames, i, coordinate, space):  # type: ignore[no-untyped-def]
    """Places a link in the frame of the one before it.

    Args:
        frames: of the arm.
        i: number of the link, from 0.
        coordinate: of its joint, in rad or m.
        space: filled in.
    """
    matrix = space.matrix[i]
    cosine, sine = cosine_and_sine(coordinate)
    for j in range(9):
        matrix[j] = frames.fixed[i, j] + cosine * frames.turned[i, j] + sine * frames.across[i, j]
    put(space.place[i], plus(triple(frames.position[i]), times(coordinate, triple(frames.slide[i]))))


@compiled
def move_links(frames, parameters, first, qvel, qacc, space):  # type: ignore[no-untyped-def]
    """Works out how links turn and accelerate where they are placed, and what that takes.  Eqs. 49 and 50.

    Args:
        frames: of the arm.
        parameters: of the joints and links (njoint x 13).
        first: the link to begin with; those before it are moved already.
        qvel: joint speeds (njoint), in rad/s or m/s.
        qacc: joint accelerations (njoint), in rad/s² or m/s².
        space: with the links placed, filled in.
    """
    spin, spin_rate, rate = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), times(-1.0, triple(frames.gravity))
    if first > 0:
        before = first - 1
        spin, spin_rate, rate = triple(space.spin[before]), triple(space.spin_rate[before]), triple(space.rate[before])
    for i in range(first, qvel.shape[0]):
        matrix, place, axis = space.matrix[i], triple(space.place[i]), triple(frames.axis[i])
        rate = plus(rate, plus(cross(spin_rate, place), cross(spin, cross(spin, place))))
        spin, spin_rate, rate = outward(matrix, spin), outward(matrix, spin_rate), outward(matrix, rate)
        if frames.is_slide[i] == 0.0:
            spin_rate = plus(spin_rate, plus(times(qacc[i], axis), times(qvel[i], cross(spin, axis))))
            spin = plus(spin, times(qvel[i], axis))
        else:
            rate = plus(rate, plus(times(qacc[i], axis), times(2.0 * qvel[i], cross(spin, axis))))
        put(space.spin[i], spin)
        put(space.spin_rate[i], spin_rate)
        put(space.rate[i], rate)
        own = parameters[i]
        mass, inertia = triple(own, 1), (triple(own, 4), triple(own, 7))
        put(space.force[i], plus(times(own[0], rate), plus(cross(spin_rate, mass), cross(spin, cross(spin, mass)))))
        turning = plus(symmetric(inertia, spin_rate), cross(spin, symmetric(inertia, spin)))
        put(space.moment[i], plus(turning, cross(mass, rate)))


@compiled
def joint_torques(frames, parameters, qacc, space, torque):  # type: ignore[no-untyped-def]
    """Works out what moves the links as they move, and the rotors; friction is left out.  Eqs. 51 and 52.

    Args:
        frames: of the arm.
        parameters: of the joints and links (njoint x 13).
        qacc: joint accelerations (njoint), in rad/s² or m/s².
        space: with what it takes to move each link.
        torque: of the joints (njoint), filled in.
    """
    force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(torque.shape[0] - 1, -1, -1):
        force, moment = plus(force, triple(space.force[i])), plus(moment, triple(space.moment[i]))
        axis = triple(frames.axis[i])
        own = dot(axis, moment) if frames.is_slide[i] == 0.0 else dot(axis, force)
        torque[i] = own + parameters[i, 10] * qacc[i]
        force, moment = inward(space.matrix[i], force), inward(space.matrix[i], moment)
        moment = plus(moment, cross(triple(space.place[i]), force))


@compiled
def accelerating_torques(frames, parameters, qpos, qvel, qacc, space, torque):  # type: ignore[no-untyped-def]
    """Works out what accelerates an arm, rotors and friction included.  Eq. 52.

    Args:
        frames: of the arm.
        parameters: of the joints and links (njoint x 13).
        qpos: joint coordinates (njoint), in rad or m.
        qvel: joint speeds (njoint), in rad/s or m/s.
        qacc: joint accelerations that are wanted (njoint), in rad/s² or m/s².
        space: filled in.
        torque: of the joints (njoint), filled in.
    """
    for i in range(torque.shape[0]):
        place_link(frames, i, qpos[i], space)
    move_links(frames, parameters, 0, qvel, qacc, space)
    joint_torques(frames, parameters, qacc, space, torque)
    for i in range(torque.shape[0]):
        torque[i] += parameters[i, 11] * qvel[i]
        torque[i] += parameters[i, 12] * min(max(qvel[i] * (1.0 / SLIDING), -1.0), 1.0)  # Eq. 12


@compiled
def kinetic_squares(frames, parameters, space, one, other):  # type: ignore[no-untyped-def]
    """vᵀ M v for two vectors of joint speeds v where the links are: twice their kinetic energies, rotors included.

    Link by link, which takes fewer steps than the mass matrix.

    Args:
        frames: of the arm.
        parameters: of the joints and links (njoint x 13).
        space: where the links are.
        one: joint speeds (njoint).
        other: joint speeds (njoint).
    """
    first_square = other_square = 0.0
    spin, speed = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    other_spin, other_speed = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(one.shape[0]):
        own, matrix, place, axis = parameters[i], space.matrix[i], triple(space.place[i]), triple(frames.axis[i])
        speed = outward(matrix, plus(speed, cross(spin, place)))
        other_speed = outward(matrix, plus(other_speed, cross(other_spin, place)))
        spin, other_spin = outward(matrix, spin), outward(matrix, other_spin)
        if frames.is_slide[i] == 0.0:
            spin, other_spin = plus(spin, times(one[i], axis)), plus(other_spin, times(other[i], axis))
        else:
            speed, other_speed = plus(speed, times(one[i], axis)), plus(other_speed, times(other[i], axis))
        first_square += _link_square(own, spin, speed) + own[10] * one[i] * one[i]
        other_square += _link_square(own, other_spin, other_speed) + own[10] * other[i] * other[i]
    return first_square, other_square


@compiled
def _link_square(own, spin, speed):  # type: ignore[no-untyped-def]
    """Twice the kinetic energy of a link that turns, and whose origin moves."""
    first, inertia = triple(own, 1), (triple(own, 4), triple(own, 7))
    moved = own[0] * dot(speed, speed) + 2.0 * dot(speed, cross(spin, first))
    return moved + dot(spin, symmetric(inertia, spin))


@compiled
def fill_mass_matrix(frames, parameters, space):  # type: ignore[no-untyped-def]
    """Fills in the mass matrix where the links are: the torque that turns each joint alone, with all that it carries
    as one body. Rotors are included.
    """
    n = space.matrix.shape[0]
    carried, matrix_of = space.carried, space.mass_matrix
    for i in range(n):
        for j in range(10):
            carried[i, j] = parameters[i, j]
    for i in range(n - 1, -1, -1):
        own, matrix, axis = carried[i], space.matrix[i], triple(frames.axis[i])
        first, inertia = triple(own, 1), (triple(own, 4), triple(own, 7))
        if frames.is_slide[i] == 0.0:
            force, moment = cross(axis, first), symmetric(inertia, axis)
            matrix_of[i, i] = dot(axis, moment) + parameters[i, 10]
        else:
            force, moment = times(own[0], axis), cross(first, axis)
            matrix_of[i, i] = dot(axis, force) + parameters[i, 10]
        for j in range(i - 1, -1, -1):
            out = space.matrix[j + 1]
            force, moment = inward(out, force), inward(out, moment)
            moment = plus(moment, cross(triple(space.place[j + 1]), force))
            other = triple(frames.axis[j])
            matrix_of[i, j] = dot(other, moment) if frames.is_slide[j] == 0.0 else dot(other, force)
        if i > 0:
            _add_carried(own, first, inertia, matrix, triple(space.place[i]), carried[i - 1])


@compiled
def _add_carried(own, first, inertia, matrix, place, below):  # type: ignore[no-untyped-def]
    """Adds what hangs on a link to the link before, at its origin."""
    mass = own[0]
    turned = inward(matrix, first)
    below[0] += mass
    below[1] += turned[0] + mass * place[0]
    below[2] += turned[1] + mass * place[1]
    below[3] += turned[2] + mass * place[2]
    # I + 2 p·h − p hᵀ − h pᵀ with h = s + m p/2: parallel axes
    one, two, three = triple(matrix), triple(matrix, 3), triple(matrix, 6)
    row0, row1, row2 = symmetric(inertia, one), symmetric(inertia, two), symmetric(inertia, three)
    half = plus(turned, times(0.5 * mass, place))
    around = 2.0 * dot(place, half)
    px, py, pz = place
    hx, hy, hz = half
    below[4] += dot(one, row0) + around - 2.0 * px * hx
    below[5] += dot(one, row1) - px * hy - hx * py
    below[6] += dot(one, row2) - px * hz - hx * pz
    below[7] += dot(two, row1) + around - 2.0 * py * hy
    below[8] += dot(two, row2) - py * hz - hy * pz
    below[9] += dot(three, row2) + around - 2.0 * pz * hz
