"""Twins of an arm whose torques are noisy: led by the readings, as an extended Kalman filter is.

Noise of the torques adds up in the motion. So the twin is set right at each reading by a gain times what it was wrong
by, the innovation. Gains and covariances of the innovations follow from a first run (Eq. 35), in which a step is
linearised by differences. In the runs of a fit they are given (Eq. 36).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.compiled.decorator import compiled
from metaid.compiled.kalman import add_noise, correct, spread_of, weigh
from metaid.compiled.spatial.dynamics import Frames, new_space
from metaid.compiled.spatial.friction import new_motion
from metaid.compiled.spatial.twins import Followed, Times, move_on, set_off, shared
from metaid.models import Array

STATE_STEP, TORQUE_STEP = 1e-7, 1e-4  # rad or m and rad/s or m/s, and N m or N: for differences


class DrivenPushes(NamedTuple):
    """Pushes of an arm by commanded torques, for one twin or several.

    Attributes:
        frames: of the arm.
        starts: joint coordinates and speeds at the starts (... x npush x 2 x njoint).
        torques: that act (npush x nstep x njoint), in N m or N.
        readings: joint coordinates (npush x nstep + 1 x njoint), in rad or m.
        steps: for how many each push is followed (npush).
        spring: stiffness of springs in the joints (njoint), in N m/rad or N/m.
        times: how twins move between two readings.
    """

    frames: Frames
    starts: Array
    torques: Array
    readings: Array
    steps: NDArray[np.int64]
    spring: Array
    times: Times


class Led(NamedTuple):
    """What a filter has, at each reading of each push: gains (npush x nstep + 1 x 2 njoint x njoint); weights L⁻¹, L Lᵀ
    being the covariance of an innovation (npush x nstep + 1 x njoint x njoint); the state after it, coordinates before
    speeds (npush x nstep + 1 x 2 njoint). And of each push the squares of its whitened innovations and the logarithms
    of the determinants of their covariances, summed up (npush x 2); NaN where the twin cannot follow.
    """

    gains: Array
    weights: Array
    states: Array
    sums: Array


def lead_arm(
    pushes: DrivenPushes, parameters: Array, begins: Array, noise: tuple[Array, Array], chosen: NDArray[np.intp]
) -> Led:
    """The filter's run through pushes.  Eq. 35.

    Args:
        pushes: what was done, and what was read; starts are npush x 2 x njoint.
        parameters: of the twin (njoint x 13).
        begins: covariance of coordinates and speeds at the starts (npush x 2 njoint x 2 njoint).
        noise: covariances of a reading and of the torques that are held for a step (njoint x njoint each).
        chosen: which pushes it runs through.
    """
    npush, nreading, n = pushes.readings.shape
    gains, weights = np.zeros((npush, nreading, 2 * n, n)), np.zeros((npush, nreading, n, n))
    led = Led(gains, weights, np.zeros((npush, nreading, 2 * n)), np.zeros((npush, 2)))
    work = new_motion(n), new_motion(n), new_space(n), np.zeros((4, n)), np.zeros((3, 2 * n, 2 * n))
    values, spread = np.array(parameters, order="C"), spread_of(n)
    for push in chosen.tolist():
        settings = pushes.spring, pushes.times.timesteps[push], pushes.times.substeps, pushes.times.is_continuous
        pushed = pushes.starts[push], begins[push], pushes.torques[push], pushes.readings[push]
        own = gains[push], weights[push], led.states[push]
        led.sums[push] = _lead_push(
            pushes.frames, values, pushed, settings, noise, pushes.steps[push], work, spread, own
        )
    return led


def follow_readings(
    pushes: DrivenPushes,
    candidates: Array,
    led: tuple[Array, Array],
    basis: Array,
    threads: int = 2,
) -> Followed:
    """Coefficients of the whitened innovations (ncandidate x npush x ncoefficient x njoint) of twins that are led by
    readings with given gains and weights.  Eq. 36.

    Args:
        pushes: what was done, and what was read; starts are ncandidate x npush x 2 x njoint.
        candidates: parameters of the twins (ncandidate x njoint x 13).
        led: gains and weights of the filter, as `Led` has them.
        basis: polynomials at every reading of each push (npush x nstep + 1 x ncoefficient).
        threads: that share the candidates.
    """
    shape = len(candidates), len(pushes.torques), basis.shape[2], pushes.torques.shape[2]

    def share(*rest: Any) -> None:
        _follow_readings(pushes, candidates, led, basis, *rest)

    return shared(share, shape, threads)


@compiled
def _lead_push(frames, parameters, pushed, settings, noise, steps, work, spread, led):  # type: ignore[no-untyped-def]
    """One push; its two sums."""
    start, begin, torques, readings = pushed
    spring, timesteps, substeps, is_continuous = settings
    of_reading, of_torque = noise
    motion, other, space, vectors, matrices = work
    gains, weights, states = led
    n = start.shape[1]
    if not set_off(frames, parameters, start, motion, space):
        return np.nan, np.nan
    for i in range(2 * n):
        for j in range(2 * n):
            spread.state[i, j] = begin[i, j]
    for i in range(n):
        other.softness[i] = motion.softness[i]
    squares, logarithm = 0.0, 0.0
    for reading in range(steps + 1):
        if reading > 0:
            before = vectors[0], vectors[1], vectors[2]
            for i in range(n):
                before[0][i], before[1][i], before[2][i] = motion.position[i], motion.speed[i], motion.side[i]
            moving = timesteps[reading - 1], substeps, is_continuous
            if not move_on(frames, parameters, torques[reading - 1], spring, moving, motion, space):
                return np.nan, np.nan
            step = before, torques[reading - 1], vectors[3], (spring, moving)
            if not _linearise(frames, parameters, step, motion, other, space, matrices, spread.pushed):
                return np.nan, np.nan
            _carry(matrices, spread.state)
            add_noise(of_torque, spread)
        logarithm += weigh(of_reading, spread)
        seen, gain, weight = readings[reading], gains[reading], weights[reading]
        squares += correct(seen, spread, motion.position, motion.speed, gain, weight)
        for i in range(n):
            states[reading, i], states[reading, n + i] = motion.position[i], motion.speed[i]
    return squares, logarithm


@compiled
def _linearise(frames, parameters, step, motion, other, space, matrices, pushed):  # type: ignore[no-untyped-def]
    """Fills in what a step makes of the state before it (the first of the `matrices`, 2n x 2n) and of its torque
    (`pushed`, 2n x n), by differences; whether a twin beside could follow. `motion` is the state after it.
    """
    before, torque, changed, (spring, times) = step
    n = torque.shape[0]
    for column in range(3 * n):
        for i in range(n):
            other.position[i], other.speed[i], other.side[i] = before[0][i], before[1][i], before[2][i]
            changed[i] = torque[i]
        size = STATE_STEP
        if column < n:
            other.position[column] += size
        elif column < 2 * n:
            other.speed[column - n] += size
        else:
            size = TORQUE_STEP
            changed[column - 2 * n] += size
        if not move_on(frames, parameters, changed, spring, times, other, space):
            return False
        for i in range(n):
            by_position, by_speed = other.position[i] - motion.position[i], other.speed[i] - motion.speed[i]
            if column < 2 * n:
                matrices[0, i, column], matrices[0, n + i, column] = by_position / size, by_speed / size
            else:
                pushed[i, column - 2 * n], pushed[n + i, column - 2 * n] = by_position / size, by_speed / size
    return True


@compiled
def _carry(matrices, state):  # type: ignore[no-untyped-def]
    """A P Aᵀ in place of the covariance P (2n x 2n), A being the first of the `matrices`."""
    slopes, carried = matrices[0], matrices[1]
    size = state.shape[0]
    for r in range(size):
        for c in range(size):
            total = 0.0
            for k in range(size):
                total += slopes[r, k] * state[k, c]
            carried[r, c] = total
    for r in range(size):
        for c in range(size):
            total = 0.0
            for k in range(size):
                total += carried[r, k] * slopes[c, k]
            state[r, c] = total


@compiled
def _follow_readings(pushes, candidates, led, basis, share, work, coefficients, arrived):  # type: ignore[no-untyped-def]
    """Runs a `share` of the candidates: the first, and the stride from one to the next."""
    frames, starts, torques, readings, steps, spring, times = pushes
    (gains, weights), (first, stride), (_, motion, space) = led, share, work
    timesteps, substeps, is_continuous = times
    for candidate in range(first, candidates.shape[0], stride):
        parameters = candidates[candidate]
        for push in range(torques.shape[0]):
            follows = set_off(frames, parameters, starts[candidate, push], motion, space)
            step, filled = 0, coefficients[candidate, push]
            while follows and steps[push] > 0:
                own = readings[push, step], gains[push, step], weights[push, step], basis[push, step]
                _set_right(*own, motion, filled)
                if step == steps[push]:
                    break
                moving = timesteps[push, step], substeps, is_continuous
                follows = move_on(frames, parameters, torques[push, step], spring, moving, motion, space)
                step += 1
            arrived[candidate, push] = follows


@compiled
def _set_right(seen, gain, weight, polynomials, motion, coefficients):  # type: ignore[no-untyped-def]
    """Adds what the innovation of a reading has of the coefficients, and sets the state right by it."""
    innovation, n = motion.beyond, seen.shape[0]
    for i in range(n):
        innovation[i] = motion.position[i] - seen[i]
    for i in range(n):
        whitened = 0.0
        for j in range(n):
            whitened += weight[i, j] * innovation[j]
            motion.position[i] -= gain[i, j] * innovation[j]
            motion.speed[i] -= gain[n + i, j] * innovation[j]
        for k in range(coefficients.shape[0]):
            coefficients[k, i] += polynomials[k] * whitened
