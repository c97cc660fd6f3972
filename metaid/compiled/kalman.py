"""The covariance of a state that a filter leads by readings, compiled: how noise widens it, how a reading lowers it.

What a filter says for noise of other sizes follows from the steps that it has linearised: `likelihood_about`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.compiled.decorator import compiled, fused
from metaid.compiled.products import BLOCK, LANES, multiply, whole
from metaid.models import Array


class Spread(NamedTuple):
    """What covariances of one push are worked out in, for n joints, angles above speeds, and one case or several, each
    with noise of another size; rows and columns beyond are zero. That of the state in each case, side by side: `state`
    (2n x ncase 2n). What a step makes of the state before it, `step` (2n x 2n), and of a torque that is held for it,
    `pushed` (2n x n); `rubbed` (n): variances of friction in it. Of one case L, L Lᵀ being the covariance of an
    innovation, `root`, and L⁻ᵀ, `turned` (n x n).
    Free to write in are `carried` and `across` (2n x ncase 2n), `changed` (n x ncase 2n) and `shared` (2n x n).
    """

    state: Array
    step: Array
    pushed: Array
    rubbed: Array
    root: Array
    turned: Array
    carried: Array
    across: Array
    changed: Array
    shared: Array


def spread_of(njoint: int, cases: int = 1) -> Spread:
    """That of `njoint` joints, in so many `cases`."""
    n, rows = whole(njoint, BLOCK), whole(2 * njoint, BLOCK)
    columns = whole(cases * rows, LANES)
    wide, tall, square = (rows, columns), (rows, n), (n, n)
    shapes = wide, (rows, rows), tall, (n,), square, square, wide, wide, (n, columns), tall
    return Spread(*(np.zeros(shape) for shape in shapes))


class Filtered(NamedTuple):
    """What a filter has of pushes, at each reading of each: gains (npush x nstep + 1 x 2n x n); weights L⁻¹, L Lᵀ being
    the covariance of an innovation (npush x nstep + 1 x n x n); the state after it (npush x nstep + 1 x 2n); and what
    it `missed`, the innovation (npush x nstep + 1 x n). Of each push the squares of its whitened innovations and the
    logarithms of the determinants of their covariances, summed up (npush x 2); NaN where the twin cannot follow. And
    where they are kept, what each step makes of the state before it (npush x nstep x 2n x 2n), and of a torque that is
    held for it, `pushed` (npush x nstep x 2n x n), and the variances of friction in it, `rubbed` (npush x nstep x n).
    """

    gains: Array
    weights: Array
    states: Array
    missed: Array
    sums: Array
    steps: Array
    pushed: Array
    rubbed: Array

    @property
    def likelihood(self) -> float:
        """The logarithm of that of the readings, but for a constant; NaN where the twin cannot follow."""
        return -0.5 * float(self.sums.sum())


def run_of(npush: int, nreading: int, n: int, is_kept: bool) -> Filtered:
    """Room for a run.

    Args:
        npush: how many pushes there are.
        nreading: how many readings of each.
        n: how many joints.
        is_kept: whether steps are to be kept.
    """
    seen, nstep = (npush, nreading), (nreading - 1) * is_kept
    shapes = (*seen, 2 * n, n), (*seen, n, n), (*seen, 2 * n), (*seen, n), (npush, 2)
    kept = (npush, nstep, 2 * n, 2 * n), (npush, nstep, 2 * n, n), (npush, nstep, n)
    return Filtered(*map(np.zeros, (*shapes, *kept)))


@compiled
def keep_step(reading, spread, run):  # type: ignore[no-untyped-def]
    """Keeps the step before a `reading` of a push in its `run`, where there is room for it."""
    if run.steps.shape[0] > 0:
        _fill(run.steps[reading - 1], spread.step)
        _fill(run.pushed[reading - 1], spread.pushed)
        for i in range(run.rubbed.shape[1]):
            run.rubbed[reading - 1, i] = spread.rubbed[i]


@compiled
def _fill(one, other):  # type: ignore[no-untyped-def]
    """Makes `one` the `other`, as far as both go."""
    for i in range(min(one.shape[0], other.shape[0])):
        for j in range(min(one.shape[1], other.shape[1])):
            one[i, j] = other[i, j]


@fused
def widen(of_torque, spread):  # type: ignore[no-untyped-def]
    """Moves the covariances of the state on by a step, with what noise of torques makes of them, whose variances in
    each case are `of_torque` (ncase x n): A P Aᵀ + Γ Q Γᵀ.
    """
    state, step, pushed = spread.state, spread.step, spread.pushed
    carried, across, changed = spread.carried, spread.across, spread.changed
    (cases, n), (rows, columns) = of_torque.shape, state.shape
    carried[:] = 0.0
    multiply(step, state, carried, 0, columns)
    for case in range(cases):
        first = case * rows
        for r in range(2 * n):
            for c in range(2 * n):
                across[c, first + r] = carried[r, first + c]
            for j in range(n):
                changed[j, first + r] = (of_torque[case, j] + spread.rubbed[j]) * pushed[r, j]
    state[:] = 0.0
    multiply(step, across, state, 0, columns)
    multiply(pushed, changed, state, 0, columns)


@compiled
def weigh(case, of_reading, spread):  # type: ignore[no-untyped-def]
    """Fills `turned` with L⁻ᵀ, L Lᵀ being the covariance of the innovation in a `case`; returns its determinant's
    logarithm.
    """
    state, root, turned = spread.state, spread.root, spread.turned
    n, first, logarithm = of_reading.shape[0], case * state.shape[0], 0.0
    for i in range(n):
        for j in range(i + 1):
            total = 0.5 * (state[i, first + j] + state[j, first + i]) + of_reading[i, j]
            for k in range(j):
                total -= root[i, k] * root[j, k]
            root[i, j] = np.sqrt(total) if i == j else total * turned[j, j]
        logarithm += 2.0 * np.log(root[i, i])
        turned[i, i] = 1.0 / root[i, i]
        for j in range(i):
            total = 0.0
            for k in range(j, i):
                total -= root[i, k] * turned[j, k]
            turned[j, i] = total * turned[i, i]
    return logarithm


@fused
def correct(case, seen, spread, angle, speed, missed):  # type: ignore[no-untyped-def]
    """Sets the state, `angle` and `speed` (n each), right by a reading and lowers its covariance in a `case`; returns
    the square of the whitened innovation.

    With P the covariance of the state, B = P Cᵀ L⁻ᵀ, and w the whitened innovation: the state moves by −B w, and P is
    lowered by B Bᵀ.

    Args:
        case: one of those of the `spread`.
        seen: the reading (n).
        spread: the covariances, with `turned` as `weigh` has filled it in; keeps B as `shared`.
        angle: of the state (n).
        speed: of the state (n).
        missed: the innovation (n) of this reading, filled in.
    """
    state, turned, shared, changed = spread.state, spread.turned, spread.shared, spread.changed
    n, rows, squares = angle.shape[0], state.shape[0], 0.0
    first = case * rows
    for r in range(2 * n):
        for j in range(n):
            total = 0.0
            for k in range(j + 1):
                total += state[r, first + k] * turned[k, j]
            shared[r, j] = total
            changed[j, first + r] = -total
    multiply(shared, changed, state, first, first + rows)
    for j in range(n):
        missed[j] = angle[j] - seen[j]
    for i in range(n):
        whitened = 0.0
        for j in range(i + 1):
            whitened += turned[j, i] * missed[j]
        squares += whitened * whitened
        for r in range(n):
            angle[r] -= shared[r, i] * whitened
            speed[r] -= shared[n + r, i] * whitened
    return squares


@compiled
def keep_gain(reading, spread, run):  # type: ignore[no-untyped-def]
    """Keeps the gain B L⁻¹ of a `reading` of a push in its `run`, and the weight L⁻¹."""
    gain, weight, turned, shared = run.gains[reading], run.weights[reading], spread.turned, spread.shared
    n = weight.shape[0]
    for j in range(n):
        for i in range(n):
            weight[i, j] = turned[j, i] if j <= i else 0.0
        for r in range(2 * n):
            total = 0.0
            for k in range(j, n):
                total += shared[r, k] * turned[j, k]
            gain[r, j] = total


def likelihood_about(
    run: Filtered, begins: Array, noise: tuple[Array, Array], steps: NDArray[np.int64], pushes: NDArray[np.intp]
) -> Array:
    """The logarithm of the likelihood of `pushes` in each case (ncase), but for a constant, by a filter for `noise` of
    other sizes than that of a `run` whose steps are kept: to first order in how far its states are from those of the
    run.  Eq. 37.

    Args:
        run: of the other filter.
        begins: covariance of the states at the starts (npush x 2n x 2n).
        noise: covariance of a reading (n x n), and variances of the torques in each case (ncase x n).
        steps: for how many each push is followed (npush).
        pushes: their numbers.
    """
    cases, n = noise[1].shape
    totals = np.zeros(cases)
    room = np.zeros((2, cases, n)), np.zeros((2, n))
    _likelihood_about(run, begins, noise, steps, pushes, spread_of(n, cases), room, totals)
    return 0.5 * totals


@compiled
def _likelihood_about(run, begins, noise, steps, pushes, spread, room, totals):  # type: ignore[no-untyped-def]
    of_reading, of_torque = noise
    (angles, speeds), (seen, missed) = room
    n, rows = of_reading.shape[0], spread.state.shape[0]
    for push in pushes:
        for case in range(totals.shape[0]):
            _fill(spread.state[:, case * rows : (case + 1) * rows], begins[push])
        angles[:] = 0.0
        speeds[:] = 0.0
        for reading in range(steps[push] + 1):
            if reading > 0:
                _fill(spread.step, run.steps[push, reading - 1])
                _fill(spread.pushed, run.pushed[push, reading - 1])
                for i in range(n):
                    spread.rubbed[i] = run.rubbed[push, reading - 1, i]
                widen(of_torque, spread)
            for i in range(n):
                seen[i] = -run.missed[push, reading, i]
            for case in range(totals.shape[0]):
                angle, speed = angles[case], speeds[case]
                if reading > 0:
                    _move(spread, angle, speed)
                totals[case] -= weigh(case, of_reading, spread)
                totals[case] -= correct(case, seen, spread, angle, speed, missed)
                for i in range(n):
                    for j in range(n):
                        angle[i] += run.gains[push, reading, i, j] * run.missed[push, reading, j]
                        speed[i] += run.gains[push, reading, n + i, j] * run.missed[push, reading, j]


@compiled
def _move(spread, angle, speed):  # type: ignore[no-untyped-def]
    """Moves on by a step how far a state is from another: `angle` and `speed` (n each)."""
    step, moved, n = spread.step, spread.carried[0], angle.shape[0]
    for r in range(2 * n):
        moved[r] = 0.0
        for i in range(n):
            moved[r] += step[r, i] * angle[i] + step[r, n + i] * speed[i]
    for i in range(n):
        angle[i], speed[i] = moved[i], moved[n + i]
