"""The twin of a plant whose torques are noisy: led by its readings, as an extended Kalman filter is, compiled.

Noise of the torque adds up in the motion, so a twin that is driven by what was commanded loses the plant. So at each
reading the twin is set right by a gain times what it was wrong by, the innovation. The gains and the covariances of the
innovations follow from a first run (Eq. 35). In the runs of the fit they are given. So an innovation is a function of
the unknowns alone, and its derivatives are exact (Eq. 36): `driven` has these runs.
"""

from __future__ import annotations

import numpy as np

from metaid.compiled import compiled, correct, keep_gain, keep_step, weigh, widen
from metaid.estimation.twin.flow import flow
from metaid.estimation.twin.joints import joint_state
from metaid.estimation.twin.state import set_off

# Friction that builds up does so by another law in every joint: what is missing yet may be off by so large a share of
# it, and bristles that are damped resist for so many s longer.
UNSURE, DAMPED = 0.2, 1e-3


@compiled
def lead(start, begin, forces, readings, balance, settings, noise, steps, work, spread, run):  # type: ignore[no-untyped-def]
    """Runs one push as the filter does (Eq. 35), and fills in its gains. Returns the sum of the squares of the whitened
    innovations and the logarithm of the determinants of their covariances; NaN where the twin cannot
    follow.

    Args:
        start: joint angles and speeds (2 x njoint) right after the push, in rad and rad/s.
        begin: covariance of angles and speeds then (2 njoint x 2 njoint), in the kernel's coordinates, as all that
            follows is.
        forces: at each step (nstep x njoint), in N m: what was commanded.
        readings: angles (nstep + 1 x njoint), in rad.
        balance: of a kernel, without a law.
        settings: timestep of each step (nstep), in s; how many timesteps a step has; whether the plant moves
            continuously.
        noise: covariance of a reading (njoint x njoint), in rad²; variances of the torques (1 x njoint), in (N m)².
        steps: for how many the push is followed.
        work: see `workspace`.
        spread: see `Spread`.
        run: a push of a `Filtered`, filled in.
    """
    timesteps, substeps, is_continuous = settings
    of_reading, of_torque = noise
    n = start.shape[1]
    set_off(start, 0, 0, work)
    for i in range(2 * n):
        for j in range(2 * n):
            spread.state[i, j] = begin[i, j]
    squares, logarithm = 0.0, 0.0
    for reading in range(steps + 1):
        if reading > 0:
            timestep = timesteps[reading - 1]
            spread.pushed[:] = 0.0
            spread.rubbed[:] = 0.0
            for i in range(2 * n):
                for j in range(2 * n):
                    spread.step[i, j] = 1.0 if i == j else 0.0
            for _ in range(substeps):
                for i in range(n):
                    work.free[i] = work.slip[0, i]
                if not flow(reading - 1, forces, balance, None, spread, timestep, is_continuous, work):
                    return np.nan, np.nan
                if is_continuous:
                    _rub(balance, timestep, substeps, spread, work)
            widen(of_torque, spread)
            keep_step(reading, spread, run)
        logarithm += weigh(0, of_reading, spread)
        squares += correct(0, readings[reading], spread, work.angle, work.speed, run.missed[reading])
        keep_gain(reading, spread, run)
        for i in range(n):
            run.states[reading, i], run.states[reading, n + i] = work.angle[i], work.speed[i]
    return squares, logarithm


@compiled
def _rub(balance, timestep, substeps, spread, work):  # type: ignore[no-untyped-def]
    """Adds to `rubbed` the variances that dry friction has in one of so many `substeps`, before which its share was
    `free`.  Eq. 35.
    """
    for i in range(work.angle.shape[0]):
        before, after, side = work.free[i], work.slip[0, i], np.sign(joint_state(i, work)[1])
        missing, built = 0.5 * (abs(side - before) + abs(side - after)), abs(after - before)
        unsure = balance.dry[i] * (UNSURE * missing + DAMPED * built / timestep)
        spread.rubbed[i] += unsure * unsure / substeps
