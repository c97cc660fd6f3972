"""The twin of a plant whose torques are noisy: led by its readings, as an extended Kalman filter is, compiled.

Noise of the torque adds up in the motion, so a twin that is driven by what was commanded loses the plant. So at each
reading the twin is set right by a gain times what it was wrong by, the innovation. The gains and the covariances of the
innovations follow from a first run (Eq. 66). In the runs of the fit they are given. So an innovation is a function of
the unknowns alone, and its derivatives are exact (Eq. 67).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from metaid.compiled import compiled
from metaid.estimation.motion import accelerate, move, set_off
from metaid.estimation.tangent import force_by_unknowns, fused, linearise, move_tangent
from metaid.models import Array


class Spread(NamedTuple):
    """What the covariance of one push is worked out in, for n links, absolute angles above speeds: of the state,
    `state` (2n x 2n); what a torque that is held for a step does to it, `pushed` (2n x n); and what is free to write
    in: `changed` (n x 2n), `shared` (2n x n), `root` and `inverse` (n x n).
    """

    state: Array
    pushed: Array
    changed: Array
    shared: Array
    root: Array
    inverse: Array


def spread_of(nlink: int) -> Spread:
    """That of `nlink` links."""
    tall, square = (2 * nlink, nlink), (nlink, nlink)
    shapes = (2 * nlink, 2 * nlink), tall, (nlink, 2 * nlink), tall, square, square
    return Spread(*(np.zeros(shape) for shape in shapes))


@compiled
def lead(start, begin, forces, readings, balance, settings, noise, steps, work, spread, gains, weights, states):  # type: ignore[no-untyped-def]
    """Runs one push as the filter does (Eq. 66), and fills in its gains. Returns the sum of the squares of the whitened
    innovations and the logarithm of the determinants of their covariances; NaN where the twin cannot
    follow.

    Args:
        start: joint speeds (njoint) right after the push, in rad/s.
        begin: covariance of the absolute speeds then (njoint x njoint), in rad²/s².
        forces: Q of Eq. 22 at each step (nstep x njoint), in N m: what was commanded.
        readings: absolute angles (nstep + 1 x njoint), in rad.
        balance, work: see `workspace`; `balance` without a law.
        settings: timestep in s; how many timesteps a step has.
        noise: covariances of a reading, in rad², and of Q, in (N m)² (njoint x njoint each).
        steps: for how many the push is followed.
        spread: see `Spread`.
        gains: (nstep + 1 x 2 njoint x njoint), filled in.
        weights: L⁻¹ with L Lᵀ the covariance of an innovation (nstep + 1 x njoint x njoint), in 1/rad, filled in.
        states: absolute angles, in rad, before speeds, in rad/s, after each reading (nstep + 1 x 2 njoint), filled in.
    """
    timestep, substeps = settings
    of_reading, of_force = noise
    n = start.shape[0]
    set_off(start, -1, work)
    spread.state[:] = 0.0
    for i in range(n):
        for j in range(n):
            spread.state[n + i, n + j] = begin[i, j]
    squares, logarithm = 0.0, 0.0
    for reading in range(steps + 1):
        if reading > 0:
            spread.pushed[:] = 0.0
            for _ in range(substeps):
                if not accelerate(reading - 1, forces, balance, work):
                    return np.nan, np.nan
                linearise(balance, work)
                _carry(spread.state, timestep, spread, work)
                _transpose(spread)
                _carry(spread.state, timestep, spread, work)
                _carry(spread.pushed, timestep, spread, work)
                for i in range(n):
                    for j in range(n):
                        spread.pushed[n + i, j] += timestep * work.solved[i, j]
                        spread.pushed[i, j] += timestep * timestep * work.solved[i, j]
                if not move(timestep, work):
                    return np.nan, np.nan
            _add_noise(of_force, spread)
        logarithm += _weigh(of_reading, spread)
        squares += _correct(readings[reading], spread, work, gains[reading], weights[reading])
        for i in range(n):
            states[reading, i], states[reading, n + i] = work.angle[i], work.speed[i]
    return squares, logarithm


@fused
def _carry(columns, timestep, spread, work):  # type: ignore[no-untyped-def]
    """Moves the `columns` (2n x any) on by the linearised step of Eq. 23: A times them."""
    n, solved, changed = work.angle.shape[0], work.solved, spread.changed
    for i in range(n):
        for p in range(columns.shape[1]):
            changed[i, p] = 0.0
        for j in range(2 * n):
            slope = solved[i, n + j]
            for p in range(columns.shape[1]):
                changed[i, p] += slope * columns[j, p]
    for i in range(n):
        for p in range(columns.shape[1]):
            columns[n + i, p] += timestep * changed[i, p]
            columns[i, p] += timestep * columns[n + i, p]


@compiled
def _transpose(spread):  # type: ignore[no-untyped-def]
    """Turns `state` into its transpose."""
    state = spread.state
    for i in range(state.shape[0]):
        for j in range(i):
            state[i, j], state[j, i] = state[j, i], state[i, j]


@fused
def _add_noise(of_force, spread):  # type: ignore[no-untyped-def]
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
def _weigh(of_reading, spread):  # type: ignore[no-untyped-def]
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
def _correct(seen, spread, work, gain, weight):  # type: ignore[no-untyped-def]
    """Sets the state right by a reading and lowers its covariance; returns the square of the whitened innovation.

    With P the covariance of the state, B = P Cᵀ L⁻ᵀ, and w the whitened innovation: the gain is B L⁻¹, P less B Bᵀ.
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
        spread.changed[0, j] = work.angle[j] - seen[j]
    for i in range(n):
        total = 0.0
        for j in range(i + 1):
            total += inverse[i, j] * spread.changed[0, j]
        squares += total * total
        for j in range(n):
            work.angle[i] -= gain[i, j] * spread.changed[0, j]
            work.speed[i] -= gain[n + i, j] * spread.changed[0, j]
    return squares


@compiled
def watch_innovations(start, forces, readings, balance, derivatives, settings, led, basis, steps, work, seen):  # type: ignore[no-untyped-def]
    """Runs one push with gains that are given (Eq. 67); whether the twin could follow.

    Args:
        start, forces, readings, balance, steps: see `lead`.
        derivatives, work: see `workspace`.
        settings: timestep in s; the column of the first start speed, or −1; how many timesteps a step has.
        led: the gains and the weights that `lead` has filled in.
        basis: the polynomials at every reading (nstep + 1 x ncoefficient), that of the push first.
        seen: coefficients (njoint x ncoefficient) of the whitened innovations and their derivatives (njoint x
            ncoefficient x nunknown), filled in.
    """
    timestep, start_column, substeps = settings
    gains, weights = led
    coefficients, slopes = seen
    set_off(start, start_column, work)
    coefficients[:] = 0.0
    slopes[:] = 0.0
    for reading in range(steps + 1):
        if reading > 0:
            for _ in range(substeps):
                if not accelerate(reading - 1, forces, balance, work):
                    return False
                linearise(balance, work)
                force_by_unknowns(derivatives, work)
                move_tangent(timestep, 0.0, False, work)
                if not move(timestep, work):
                    return False
        _correct_tangent(gains[reading], weights[reading], basis[reading], work, slopes)
        _correct_state(readings[reading], gains[reading], weights[reading], basis[reading], work, coefficients)
    return True


@fused
def _correct_state(seen, gain, weight, polynomials, work, coefficients):  # type: ignore[no-untyped-def]
    """Adds what the innovation of a reading has of the coefficients, and sets the state right by it. `cosine` is free
    until the next step.
    """
    innovation = work.cosine
    n = innovation.shape[0]
    for i in range(n):
        innovation[i] = work.angle[i] - seen[i]
    for i in range(n):
        whitened = 0.0
        for j in range(n):
            whitened += weight[i, j] * innovation[j]
            work.angle[i] -= gain[i, j] * innovation[j]
            work.speed[i] -= gain[n + i, j] * innovation[j]
        for k in range(coefficients.shape[1]):
            coefficients[i, k] += polynomials[k] * whitened


@fused
def _correct_tangent(gain, weight, polynomials, work, slopes):  # type: ignore[no-untyped-def]
    """The same of the derivatives. `changed` is free until the next step."""
    moved, changed = work.moved, work.changed
    n, ncoefficient, nunknown = slopes.shape
    for i in range(n):
        row, own = changed[i, :nunknown], moved[i, :nunknown]
        for p in range(row.shape[0]):
            row[p] = own[p]
    for r in range(2 * n):
        row = moved[r, :nunknown]
        for j in range(n):
            share, other = gain[r, j], changed[j, :nunknown]
            for p in range(row.shape[0]):
                row[p] -= share * other[p]
    for i in range(n - 1, -1, -1):  # from the last on: L⁻¹ is triangular
        row, scale = changed[i, :nunknown], weight[i, i]
        for p in range(row.shape[0]):
            row[p] *= scale
        for j in range(i):
            share, other = weight[i, j], changed[j, :nunknown]
            for p in range(row.shape[0]):
                row[p] += share * other[p]
        for k in range(ncoefficient):
            polynomial, slope = polynomials[k], slopes[i, k]
            for p in range(slope.shape[0]):
                slope[p] += polynomial * row[p]
