"""The covariance of a state that a filter leads by readings, compiled: how noise widens it, how a reading lowers it.

What a filter says for noise of other sizes follows from the steps that it has linearised: `likelihood_about`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.compiled.decorator import compiled, fused
from metaid.models import Array


class Spread(NamedTuple):
    """What the covariance of one push is worked out in, for n joints, angles above speeds: of the state,
    `state` (2n x 2n); what a step makes of the state before it, `step` (2n x 2n), and of a torque that is held for it,
    `pushed` (2n x n); and what is free to write in: `carried` (2n x 2n), `changed` (n x 2n), `shared` (2n x n), `root`
    and `inverse` (n x n).
    """

    state: Array
    step: Array
    pushed: Array
    carried: Array
    changed: Array
    shared: Array
    root: Array
    inverse: Array


def spread_of(njoint: int) -> Spread:
    """That of `njoint` joints."""
    whole, tall, square = (2 * njoint, 2 * njoint), (2 * njoint, njoint), (njoint, njoint)
    shapes = whole, whole, tall, whole, (njoint, 2 * njoint), tall, square, square
    return Spread(*(np.zeros(shape) for shape in shapes))


class Run(NamedTuple):
    """What a filter has of pushes, at each reading of each: gains (npush x nstep + 1 x 2n x n); weights L⁻¹, L Lᵀ being
    the covariance of an innovation (npush x nstep + 1 x n x n); the state after it (npush x nstep + 1 x 2n); and what
    it `missed`, the innovation (npush x nstep + 1 x n). Of each push the squares of its whitened innovations and the
    logarithms of the determinants of their covariances, summed up (npush x 2); NaN where the twin cannot follow. And
    where they are kept, what each step makes of the state before it (npush x nstep x 2n x 2n), and of a torque that is
    held for it, `pushed` (npush x nstep x 2n x n).
    """

    gains: Array
    weights: Array
    states: Array
    missed: Array
    sums: Array
    steps: Array
    pushed: Array


def run_of(npush: int, nreading: int, n: int, is_kept: bool) -> Run:
    """Room for a run.

    Args:
        npush: how many pushes there are.
        nreading: how many readings of each.
        n: how many joints.
        is_kept: whether steps are to be kept.
    """
    seen, nstep = (npush, nreading), (nreading - 1) * is_kept
    shapes = (*seen, 2 * n, n), (*seen, n, n), (*seen, 2 * n), (*seen, n), (npush, 2)
    return Run(*map(np.zeros, (*shapes, (npush, nstep, 2 * n, 2 * n), (npush, nstep, 2 * n, n))))


@compiled
def keep_step(reading, spread, run):  # type: ignore[no-untyped-def]
    """Keeps the step before a `reading` of a push in its `run`, where there is room for it."""
    if run.steps.shape[0] > 0:
        _fill(run.steps[reading - 1], spread.step)
        _fill(run.pushed[reading - 1], spread.pushed)


@compiled
def _fill(one, other):  # type: ignore[no-untyped-def]
    for i in range(one.shape[0]):
        for j in range(one.shape[1]):
            one[i, j] = other[i, j]


@fused
def widen(of_force, spread):  # type: ignore[no-untyped-def]
    """Moves the covariance of the state on by a step, with what noise of its torques makes: A P Aᵀ + Γ Q Γᵀ."""
    state, step, carried = spread.state, spread.step, spread.carried
    pushed, changed = spread.pushed, spread.changed
    n = of_force.shape[0]
    for r in range(2 * n):
        for c in range(2 * n):
            carried[r, c] = 0.0
        for k in range(2 * n):
            slope = step[r, k]
            for c in range(2 * n):
                carried[r, c] += slope * state[k, c]
    for r in range(2 * n):
        for c in range(2 * n):
            total = 0.0
            for k in range(2 * n):
                total += carried[r, k] * step[c, k]
            state[r, c] = total
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
def correct(seen, spread, angle, speed, run):  # type: ignore[no-untyped-def]
    """Sets the state, `angle` and `speed` (n each), right by a reading and lowers its covariance; returns the square of
    the whitened innovation.

    With P the covariance of the state, B = P Cᵀ L⁻ᵀ, and w the whitened innovation: the gain is B L⁻¹, P less B Bᵀ.

    Args:
        seen: the reading (n).
        spread: the covariance, with `inverse` as `weigh` has filled it in.
        angle: of the state (n).
        speed: of the state (n).
        run: the gain (2n x n), the weight L⁻¹ (n x n) and the innovation (n) of this reading, filled in.
    """
    gain, weight, missed = run
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
        missed[j] = angle[j] - seen[j]
    for i in range(n):
        total = 0.0
        for j in range(i + 1):
            total += inverse[i, j] * missed[j]
        squares += total * total
        for j in range(n):
            angle[i] -= gain[i, j] * missed[j]
            speed[i] -= gain[n + i, j] * missed[j]
    return squares


def likelihood_about(
    run: Run, begins: Array, noise: tuple[Array, Array], steps: NDArray[np.int64], pushes: NDArray[np.intp]
) -> float:
    """The logarithm of the likelihood of `pushes`, but for a constant, by a filter for `noise` of other sizes than that
    of a `run` whose steps are kept: to first order in how far its states are from those of the run.  Eq. 37.

    Args:
        run: of the other filter.
        begins: covariance of the states at the starts (npush x 2n x 2n).
        noise: covariances of a reading and of the torques that are held for a step (n x n each).
        steps: for how many each push is followed (npush).
        pushes: their numbers.
    """
    n = begins.shape[1] // 2
    room = np.zeros((2, n)), (np.zeros((2 * n, n)), np.zeros((n, n)), np.zeros(n))
    return float(_likelihood_about(run, begins, noise, steps, pushes, spread_of(n), room))


@compiled
def _likelihood_about(run, begins, noise, steps, pushes, spread, room):  # type: ignore[no-untyped-def]
    (of_reading, of_force), (away, own), total = noise, room, 0.0
    n, seen = of_reading.shape[0], own[2]
    for push in pushes:
        _fill(spread.state, begins[push])
        for i in range(n):
            away[0, i] = away[1, i] = 0.0
        for reading in range(steps[push] + 1):
            if reading > 0:
                _fill(spread.step, run.steps[push, reading - 1])
                _fill(spread.pushed, run.pushed[push, reading - 1])
                _move(spread, away)
                widen(of_force, spread)
            for i in range(n):
                seen[i] = -run.missed[push, reading, i]
            total -= weigh(of_reading, spread)
            total -= correct(seen, spread, away[0], away[1], own)
            for i in range(n):
                for j in range(n):
                    away[0, i] += run.gains[push, reading, i, j] * run.missed[push, reading, j]
                    away[1, i] += run.gains[push, reading, n + i, j] * run.missed[push, reading, j]
    return 0.5 * total


@compiled
def _move(spread, away):  # type: ignore[no-untyped-def]
    """Moves how far a state is `away` (2 x n) from another on by a step."""
    step, moved, n = spread.step, spread.carried[0], away.shape[1]
    for r in range(2 * n):
        moved[r] = 0.0
        for i in range(n):
            moved[r] += step[r, i] * away[0, i] + step[r, n + i] * away[1, i]
    for i in range(n):
        away[0, i], away[1, i] = moved[i], moved[n + i]
