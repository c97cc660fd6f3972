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
from metaid.compiled.kalman import Run, correct, keep_step, run_of, spread_of, weigh, widen
from metaid.compiled.spatial.dynamics import Frames, new_space
from metaid.compiled.spatial.friction import new_motion
from metaid.compiled.spatial.twins import MIDPOINT, Followed, Times, move_on, set_off, shared
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
        by_angle: what acts by the coordinate of a joint (5 x njoint), see `twins.push_by_torque`.
        times: how twins move between two readings.
    """

    frames: Frames
    starts: Array
    torques: Array
    readings: Array
    steps: NDArray[np.int64]
    by_angle: Array
    times: Times


def lead_arm(
    pushes: DrivenPushes,
    parameters: Array,
    begins: Array,
    noise: tuple[Array, Array],
    chosen: NDArray[np.intp],
    is_kept: bool,
) -> Run:
    """The filter's run through pushes.  Eq. 35.

    Args:
        pushes: what was done, and what was read; starts are npush x 2 x njoint.
        parameters: of the twin (njoint x 13).
        begins: covariance of coordinates and speeds at the starts (npush x 2 njoint x 2 njoint).
        noise: covariances of a reading and of the torques that are held for a step (njoint x njoint each).
        chosen: which pushes it runs through.
        is_kept: whether its steps are kept.
    """
    npush, nreading, n = pushes.readings.shape
    run = run_of(npush, nreading, n, is_kept)
    work, spread = (new_motion(n), new_motion(n), new_space(n), np.zeros((7, n))), spread_of(n)
    values = np.array(parameters, order="C")
    for push in chosen.tolist():
        settings = pushes.by_angle, pushes.times.timesteps[push], pushes.times.substeps, pushes.times.order
        pushed = pushes.starts[push], begins[push], pushes.torques[push], pushes.readings[push]
        own = Run(*(each[push] for each in run))
        run.sums[push] = _lead_push(
            pushes.frames, values, pushed, settings, noise, pushes.steps[push], work, spread, own
        )
    return run


def follow_readings(
    pushes: DrivenPushes,
    candidates: Array,
    led: tuple[Array, Array],
    basis: Array,
) -> Followed:
    """Coefficients of the whitened innovations (ncandidate x npush x ncoefficient x njoint) of twins that are led by
    readings with given gains and weights.  Eq. 36.

    Args:
        pushes: what was done, and what was read; starts are ncandidate x npush x 2 x njoint.
        candidates: parameters of the twins (ncandidate x njoint x 13).
        led: gains and weights of the filter, as `Led` has them.
        basis: polynomials at every reading of each push (npush x nstep + 1 x ncoefficient).
    """
    shape = len(candidates), len(pushes.torques), basis.shape[2], pushes.torques.shape[2]

    def share(*rest: Any) -> None:
        _follow_readings(pushes, candidates, led, basis, *rest)

    return shared(share, shape, int(pushes.steps.sum()) * pushes.times.substeps)


@compiled
def _lead_push(frames, parameters, pushed, settings, noise, steps, work, spread, run):  # type: ignore[no-untyped-def]
    """One push; its two sums."""
    start, begin, torques, readings = pushed
    by_angle, timesteps, substeps, order = settings
    of_reading, of_torque = noise
    motion, other, space, vectors = work
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
            before = vectors[0], vectors[1], vectors[2], vectors[3]
            for i in range(n):
                before[0][i], before[1][i] = motion.position[i], motion.speed[i]
                before[2][i], before[3][i] = motion.side[i], motion.slip[0, i]
            moving = timesteps[reading - 1], substeps, order
            if not move_on(frames, parameters, torques[reading - 1], by_angle, moving, motion, space):
                return np.nan, np.nan
            step = before, torques[reading - 1], (vectors[4], vectors[5], vectors[6]), (by_angle, moving)
            if not _linearise(frames, parameters, step, other, space, spread):
                return np.nan, np.nan
            widen(of_torque, spread)
            keep_step(reading, spread, run)
        logarithm += weigh(of_reading, spread)
        own = run.gains[reading], run.weights[reading], run.missed[reading]
        squares += correct(readings[reading], spread, motion.position, motion.speed, own)
        for i in range(n):
            run.states[reading, i], run.states[reading, n + i] = motion.position[i], motion.speed[i]
    return squares, logarithm


@compiled
def _linearise(frames, parameters, step, other, space, spread):  # type: ignore[no-untyped-def]
    """Fills in what a step makes of the state before it and of its torque, by differences; whether a twin beside could
    follow. Midpoint steps serve, and take half of the time.
    """
    moved, pushed = spread.step, spread.pushed
    before, torque, (changed, position, speed), (by_angle, times) = step
    timestep, substeps, order = times
    rough = timestep, substeps, min(order, MIDPOINT)
    n = torque.shape[0]
    for column in range(-1, 3 * n):
        for i in range(n):
            other.position[i], other.speed[i] = before[0][i], before[1][i]
            other.side[i], other.slip[0, i] = before[2][i], before[3][i]
            changed[i] = torque[i]
        size = STATE_STEP
        if 0 <= column < n:
            other.position[column] += size
        elif n <= column < 2 * n:
            other.speed[column - n] += size
        elif column >= 0:
            size = TORQUE_STEP
            changed[column - 2 * n] += size
        if not move_on(frames, parameters, changed, by_angle, rough, other, space):
            return False
        for i in range(n):
            if column < 0:
                position[i], speed[i] = other.position[i], other.speed[i]
            by_position, by_speed = other.position[i] - position[i], other.speed[i] - speed[i]
            if 0 <= column < 2 * n:
                moved[i, column], moved[n + i, column] = by_position / size, by_speed / size
            elif column >= 0:
                pushed[i, column - 2 * n], pushed[n + i, column - 2 * n] = by_position / size, by_speed / size
    return True


@compiled
def _follow_readings(pushes, candidates, led, basis, share, work, coefficients, arrived):  # type: ignore[no-untyped-def]
    """Runs a `share` of the candidates: the first, and the stride from one to the next."""
    frames, starts, torques, readings, steps, by_angle, times = pushes
    (gains, weights), (first, stride), (_, motion, space) = led, share, work
    timesteps, substeps, order = times
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
                moving = timesteps[push, step], substeps, order
                follows = move_on(frames, parameters, torques[push, step], by_angle, moving, motion, space)
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
