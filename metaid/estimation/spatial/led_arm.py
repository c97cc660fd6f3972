"""The twin of an arm that is led by readings: the filter's run through a trial, and the fit's with its gains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from metaid.compiled.spatial import DrivenPushes, Times, follow_readings, lead_arm
from metaid.estimation.spatial.driven import coefficients_of, twins_beside
from metaid.estimation.spatial.motions import THREADS
from metaid.estimation.spatial.unknowns import ArmUnknowns
from metaid.estimation.trials import Coefficients, Driven, Gains, Joints, ReadTrial
from metaid.models import Array


def watch_arm(
    driven: Driven, led: Gains, searched: ArmUnknowns, unknowns: Array, gravity: float, joints: Joints | None
) -> Coefficients | None:
    """The whitened innovations of a trial in polynomials, and their derivatives; None where a twin cannot follow.

    Args:
        driven: the trial.
        led: gains of the filter.
        searched: what is unknown of the arm.
        unknowns: where it is (nunknown).
        gravity: that of the arm counts.
        joints: what these have beside the base parameters; None for nothing.
    """
    trial, _, steps, basis = driven
    beside = twins_beside(driven, searched, unknowns, joints)
    read = trial.readings - beside.offset
    settings = steps, beside.spring, Times(trial.timesteps, trial.substeps, trial.is_continuous)
    pushes = DrivenPushes(beside.frames, beside.starts, trial.torques, read, *settings)
    twin = follow_readings(pushes, beside.candidates, (led.gains, led.weights), np.ascontiguousarray(basis), THREADS)
    return coefficients_of(twin, steps) if twin.arrived[:, steps > 0].all() else None


def lead_arm_trial(
    trial: ReadTrial,
    begun: tuple[Array, Array],
    pushes: NDArray[np.intp],
    searched: ArmUnknowns,
    unknowns: Array,
    gravity: float,
    joints: Joints | None,
    torque_noise: Array,
) -> Gains:
    """The filter's run through some pushes of a trial.  Eq. 66.

    Args:
        trial: with the torques that acted.
        begun: joint coordinates and speeds at the starts (npush x 2 x njoint), and their covariance there (npush x
            2 njoint x 2 njoint).
        pushes: which it runs through.
        searched: what is unknown of the arm.
        unknowns: where it is (nunknown).
        gravity: that of the arm counts.
        joints: what these have beside the base parameters; None for nothing.
        torque_noise: standard deviation of the torque of each joint (njoint), in N m or N.
    """
    starts, begins = begun
    alike = Driven(replace(trial, start_spread=None), starts, trial.steps, np.zeros((len(starts), 1, 1)))
    beside = twins_beside(alike, searched.alone(unknowns), np.empty(0), joints)
    settings = trial.steps, beside.spring, Times(trial.timesteps, trial.substeps, trial.is_continuous)
    read = np.ascontiguousarray(trial.readings - beside.offset)
    driven = DrivenPushes(beside.frames, beside.starts[0], trial.torques, read, *settings)
    noise = np.diag(trial.noise**2), np.diag(torque_noise**2)
    led = lead_arm(driven, beside.candidates[0], np.ascontiguousarray(begins), noise, pushes)
    n = trial.readings.shape[2]
    led.states[..., :n] += beside.offset
    squares, logarithm = led.sums.sum(axis=0)
    return Gains(led.gains, led.weights, led.states, -0.5 * float(squares + logarithm))
