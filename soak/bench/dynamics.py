"""The motion of the bench: Kane's equations of serial hinges, friction with bristles, a drive that lags; compiled."""

from __future__ import annotations

from math import cos, exp, sin
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Joints(NamedTuple):
    """What acts in the joints (n each) beside the drives: viscous friction in N m s; dry friction in N m, with how much
    larger stiction is, at what speed in rad/s it is gone, and how far in rad bristles bend; cogging in N m, so many
    times a turn; a cable in N m/rad, and the angle in rad where it is slack.
    """

    viscous: Array
    dry: Array
    stiction: float
    stribeck: float
    bending: float
    cogging: Array
    teeth: float
    cable: Array
    slack: float


class Room(NamedTuple):
    """What the equations of n joints are worked out in: of each link its joint's place and axis, its centre of mass,
    the force and the moment on it (n x 3 each), its inertia (n x 3 x 3); rotations (4 x 3 x 3) and vectors (8 x 3); the
    mass matrix (n x n) and the forces (n); the four stages of a step (5 x 4 x n).
    """

    places: Array
    axes: Array
    centres: Array
    forces: Array
    moments: Array
    inertias: Array
    turns: Array
    vectors: Array
    mass: Array
    bias: Array
    stages: Array


def room(n: int) -> Room:
    """That of `n` joints."""
    of_each = (np.zeros((n, 3)) for _ in range(5))
    shapes = (n, 3, 3), (4, 3, 3), (8, 3), (n, n), (n,), (5, 4, n)
    return Room(*of_each, *(np.zeros(shape) for shape in shapes))


@njit(cache=True, nogil=True)
def equations(arm: Any, angles: Any, speeds: Any, room: Any) -> None:
    """Fills in the mass matrix (n x n), in kg m², and the torques that hold the arm at these speeds without
    acceleration (n).
    """
    n, turn, before, spun, skew = angles.shape[0], room.turns[0], room.turns[1], room.turns[2], room.turns[3]
    place, spin, spin_rate, lift, offset, at_com, reach, held = room.vectors
    for a in range(3):
        place[a] = spin[a] = spin_rate[a] = lift[a] = 0.0
        for b in range(3):
            turn[a, b] = 1.0 if a == b else 0.0
    for i in range(n):
        _times(turn, arm.places[i], offset)
        _carry(spin, spin_rate, lift, offset, held, lift)
        for a in range(3):
            place[a] += offset[a]
        _multiply(turn, arm.turns[i], before)
        _times(before, arm.axes[i], room.axes[i])
        _rodrigues(arm.axes[i], angles[i], skew)
        _multiply(before, skew, turn)
        axis = room.axes[i]
        _cross(spin, axis, held)
        for a in range(3):
            spin_rate[a] += held[a] * speeds[i]
            spin[a] += axis[a] * speeds[i]
        _times(turn, arm.coms[i], reach)
        _multiply(turn, arm.inertias[i], spun)
        inertia = room.inertias[i]
        for a in range(3):
            for b in range(3):
                inertia[a, b] = spun[a, 0] * turn[b, 0] + spun[a, 1] * turn[b, 1] + spun[a, 2] * turn[b, 2]
        _carry(spin, spin_rate, lift, reach, held, at_com)
        _times(inertia, spin, held)
        _cross(spin, held, room.moments[i])
        _times(inertia, spin_rate, held)
        for a in range(3):
            room.moments[i, a] += held[a]
            room.places[i, a], room.centres[i, a] = place[a], place[a] + reach[a]
            room.forces[i, a] = arm.masses[i] * (at_com[a] - arm.gravity[a])
    _project(arm, room)


@njit(cache=True, nogil=True)
def _project(arm: Any, room: Any) -> None:
    """Kane's generalised forces, by how each joint moves each link."""
    n = room.bias.shape[0]
    moved, other, held, offset = room.vectors[4], room.vectors[5], room.vectors[6], room.vectors[7]
    room.mass[:] = 0.0
    room.bias[:] = 0.0
    for link in range(n):
        for j in range(link + 1):
            for a in range(3):
                offset[a] = room.centres[link, a] - room.places[j, a]
            _cross(room.axes[j], offset, moved)
            room.bias[j] += _dot(moved, room.forces[link]) + _dot(room.axes[j], room.moments[link])
            _times(room.inertias[link], room.axes[j], held)
            for k in range(j + 1):
                for a in range(3):
                    offset[a] = room.centres[link, a] - room.places[k, a]
                _cross(room.axes[k], offset, other)
                room.mass[j, k] += arm.masses[link] * _dot(moved, other) + _dot(held, room.axes[k])
    for j in range(n):
        room.mass[j, j] += arm.rotors[j]
        for k in range(j):
            room.mass[k, j] = room.mass[j, k]


@njit(inline="always")
def _dot(one: Any, other: Any) -> Any:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


@njit(inline="always")
def _cross(one: Any, other: Any, into: Any) -> None:
    x = one[1] * other[2] - one[2] * other[1]
    y = one[2] * other[0] - one[0] * other[2]
    into[2] = one[0] * other[1] - one[1] * other[0]
    into[0], into[1] = x, y


@njit(inline="always")
def _times(matrix: Any, vector: Any, into: Any) -> None:
    for a in range(3):
        into[a] = matrix[a, 0] * vector[0] + matrix[a, 1] * vector[1] + matrix[a, 2] * vector[2]


@njit(inline="always")
def _multiply(one: Any, other: Any, into: Any) -> None:
    for a in range(3):
        for b in range(3):
            into[a, b] = one[a, 0] * other[0, b] + one[a, 1] * other[1, b] + one[a, 2] * other[2, b]


@njit(cache=True, nogil=True)
def _carry(spin: Any, spin_rate: Any, lift: Any, offset: Any, held: Any, into: Any) -> None:
    """The acceleration of a point so far from one that has that of `lift`."""
    x = spin_rate[1] * offset[2] - spin_rate[2] * offset[1]
    y = spin_rate[2] * offset[0] - spin_rate[0] * offset[2]
    z = spin_rate[0] * offset[1] - spin_rate[1] * offset[0]
    _cross(spin, offset, held)
    into[0] = lift[0] + x + spin[1] * held[2] - spin[2] * held[1]
    into[1] = lift[1] + y + spin[2] * held[0] - spin[0] * held[2]
    into[2] = lift[2] + z + spin[0] * held[1] - spin[1] * held[0]


@njit(cache=True, nogil=True)
def _rodrigues(axis: Any, angle: float, into: Any) -> None:
    """The rotation by an `angle` about an `axis`."""
    x, y, z = axis[0], axis[1], axis[2]
    s, c = sin(angle), cos(angle)
    d = 1.0 - c
    into[0, 0], into[0, 1], into[0, 2] = c + d * x * x, d * x * y - s * z, d * x * z + s * y
    into[1, 0], into[1, 1], into[1, 2] = d * x * y + s * z, c + d * y * y, d * y * z - s * x
    into[2, 0], into[2, 1], into[2, 2] = d * x * z - s * y, d * y * z + s * x, c + d * z * z


@njit(cache=True, nogil=True)
def _rates(arm: Any, joints: Any, lag: float, state: Any, wanted: Any, rates: Any, room: Any) -> None:
    """Fills in how angles, speeds, bristles and drive torques (4 x n) change."""
    angles, speeds, bristles, torques = state[0], state[1], state[2], state[3]
    equations(arm, angles, speeds, room)
    force = rates[1]
    for i in range(angles.shape[0]):
        force[i] = (torques[i] if lag > 0.0 else wanted[i]) - room.bias[i]
        force[i] -= joints.viscous[i] * speeds[i] + joints.cable[i] * (angles[i] - joints.slack)
        force[i] += joints.cogging[i] * sin(joints.teeth * angles[i] + 1.0)
        rates[2, i] = rates[3, i] = 0.0
        if joints.dry[i] > 0.0:
            stiffness = joints.dry[i] / joints.bending
            most = joints.dry[i] * (1.0 + (joints.stiction - 1.0) * exp(-((speeds[i] / joints.stribeck) ** 2)))
            rates[2, i] = speeds[i] - abs(speeds[i]) * bristles[i] * stiffness / most
            force[i] -= stiffness * (bristles[i] + 1e-3 * rates[2, i])
        if lag > 0.0:
            rates[3, i] = (wanted[i] - torques[i]) / lag
        rates[0, i] = speeds[i]
    _solve(room.mass, force)


@njit(cache=True, nogil=True)
def _solve(matrix: Any, vector: Any) -> None:
    """Turns a vector into the inverse of a positive definite matrix times it, by Cholesky's factors in its place."""
    n = vector.shape[0]
    for i in range(n):
        for j in range(i + 1):
            entry = matrix[i, j]
            for k in range(j):
                entry -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = entry**0.5 if i == j else entry / matrix[j, j]
        for k in range(i):
            vector[i] -= matrix[i, k] * vector[k]
        vector[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            vector[i] -= matrix[k, i] * vector[k]
        vector[i] /= matrix[i, i]


@njit(cache=True, nogil=True)
def advance(arm: Any, joints: Any, drive: Any, state: Any, shown: Any, times: Any, commands: Any, room: Any) -> None:
    """Moves the bench on by a tick.

    Args:
        arm, joints: what moves, and what acts beside the drives.
        drive: the lag in s; the lag of the speeds that are shown, in s; how many steps, and their length in s.
        state: angles, speeds, bristles and drive torques (4 x n), moved on.
        shown: speeds as they are shown (n), in rad/s, moved on.
        times: since the tick, in s, from which on each of the `commands` holds; the first does at its begin.
        commands: what the drives are told (ncommand x n), in N m.
        room: to work in.
    """
    lag, slow, steps, step = drive
    number, count = 0, shown.shape[0]
    tried = room.stages[4]
    for moment in range(steps):
        while number + 1 < times.shape[0] and times[number + 1] <= (moment + 0.5) * step:
            number += 1
        wanted = commands[number]
        for stage in range(4):
            ahead = 0.0 if stage == 0 else step if stage == 3 else 0.5 * step
            for kind in range(4):
                for i in range(count):
                    tried[kind, i] = state[kind, i] + (ahead * room.stages[stage - 1, kind, i] if stage else 0.0)
            _rates(arm, joints, lag, tried, wanted, room.stages[stage], room)
        for kind in range(4):
            for i in range(count):
                between = room.stages[1, kind, i] + room.stages[2, kind, i]
                state[kind, i] += step / 6.0 * (room.stages[0, kind, i] + 2.0 * between + room.stages[3, kind, i])
        if slow > 0.0:
            for i in range(count):
                shown[i] += (1.0 - exp(-step / slow)) * (state[1, i] - shown[i])
