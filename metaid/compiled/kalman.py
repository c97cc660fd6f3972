"""The covariance of a state that a filter leads by readings, compiled: how noise widens it, how a reading lowers it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from metaid.compiled.decorator import compiled, fused
from metaid.models import Array


class Spread(NamedTuple):
    """What the covariance of one push is worked out in, for n joints, angles above speeds: of the state,
    `state` (2n x 2n); what a torque that is held for a step does to it, `pushed` (2n x n); and what is free to write
    in: `changed` (n x 2n), `shared` (2n x n), `root` and `inverse` (n x n).
    """

    state: Array
    pushed: Array
    changed: Array
    shared: Array
    root: Array
    inverse: Array


def spread_of(njoint: int) -> Spread:
    """That of `njoint` joints."""
    tall, square = (2 * njoint, njoint), (njoint, njoint)
    shapes = (2 * njoint, 2 * njoint), tall, (njoint, 2 * njoint), tall, square, square
    return Spread(*(np.zeros(shape) for shape in shapes))


@compiled
def transpose(spread):  # type: ignore[no-untyped-def]
    """Turns `state` into its transpose."""
    state = spread.state
    for i in range(state.shape[0]):
        for j in range(i):
            state[i, j], state[j, i] = state[j, i], state[i, j]


@fused
def add_noise(of_force, spread):  # type: ignore[no-untyped-def]
    """Adds to the covariance of the state what noise of a step's torques makes: Γ Q Γᵀ."""
    state, pushed, changed = spread.state, spread.pushed, spread.changed
    n = of_force.shape[0]
    for r in range(2 * n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += pushed[r, k] * of_force[k, j]
            changed[0, j] = total
        for c in range(2 * n):
            for j in range(n):
                state[r, c] += changed[0, j] * pushed[c, j]


@compiled
def weigh(of_reading, spread):  # type: ignore[no-untyped-def]
    """Fills `inverse` with L⁻¹, L Lᵀ being the covariance of the innovation; returns its determinant's logarithm."""
    state, root, inverse = spread.state, spread.root, spread.inverse
    n, logarithm = root.shape[0], 0.0
    for i in range(n):
        for j in range(i + 1):
            total = 0.5 * (state[i, j] + state[j, i]) + of_reading[i, j]
            for k in range(j):
                total -= root[i, k] * root[j, k]
            root[i, j] = np.sqrt(total) if i == j else total / root[j, j]
        logarithm += 2.0 * np.log(root[i, i])
        for j in range(i + 1):
            total = 1.0 if i == j else 0.0
            for k in range(j, i):
                total -= root[i, k] * inverse[k, j]
            inverse[i, j] = total / root[i, i]
    return logarithm


@fused
def correct(seen, spread, angle, speed, gain, weight):  # type: ignore[no-untyped-def]
    """Sets the state, `angle` and `speed` (n each), right by a reading and lowers its covariance; returns the square of
    the whitened innovation.

    With P the covariance of the state, B = P Cᵀ L⁻ᵀ, and w the whitened innovation: the gain is B L⁻¹, P less B Bᵀ.

    Args:
        seen: the reading (n).
        spread: the covariance, with `inverse` as `weigh` has filled it in.
        angle: of the state (n).
        speed: of the state (n).
        gain: of this reading (2n x n), filled in.
        weight: L⁻¹ (n x n), filled in.
    """
    state, inverse, shared = spread.state, spread.inverse, spread.shared
    n, squares = inverse.shape[0], 0.0
    for i in range(n):
        for j in range(n):
            weight[i, j] = inverse[i, j] if j <= i else 0.0
    for r in range(2 * n):
        for j in range(n):
            total = 0.0
            for k in range(j + 1):
                total += state[r, k] * inverse[j, k]
            shared[r, j] = total
        for j in range(n):
            total = 0.0
            for k in range(j, n):
                total += shared[r, k] * inverse[k, j]
            gain[r, j] = total
    for r in range(2 * n):
        for c in range(2 * n):
            for j in range(n):
                state[r, c] -= shared[r, j] * shared[c, j]
    for j in range(n):
        spread.changed[0, j] = angle[j] - seen[j]
    for i in range(n):
        total = 0.0
        for j in range(i + 1):
            total += inverse[i, j] * spread.changed[0, j]
        squares += total * total
        for j in range(n):
            angle[i] -= gain[i, j] * spread.changed[0, j]
            speed[i] -= gain[n + i, j] * spread.changed[0, j]
    return squares
