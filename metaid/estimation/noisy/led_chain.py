"""The twin of a chain that is led by readings: the filter's run through a trial, and the fit's with its gains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import spread_of
from metaid.estimation.noisy.filtered import lead, watch_innovations
from metaid.estimation.trials import Coefficients, Driven, Gains, Joints, ReadTrial
from metaid.estimation.twin import share_out
from metaid.estimation.unknowns import Unknowns
from metaid.estimation.workspace import balance, derivatives, workspace
from metaid.models import Array


def watch_chain(
    driven: Driven, led: Gains, unknowns: Unknowns, log_factors: Array, gravity: float, joints: Joints | None
) -> Coefficients | None:
    """The whitened innovations of a trial in polynomials, and their derivatives; None where the twin cannot follow.

    Args:
        driven: the trial.
        led: gains of the filter.
        unknowns: what is unknown of the chain.
        log_factors: where it is (nunknown).
        gravity: in m/s².
        joints: what these have beside the lumps; None for nothing.
    """
    trial, starts, steps, basis = driven
    lumps, (npush, _, n), coefficients = unknowns.lumps(log_factors), starts.shape, basis.shape[2]
    extra = 0 if trial.start_spread is None else trial.start_spread.shape[-1]
    columns = len(log_factors) + extra
    values, slopes = np.empty((npush, n, coefficients)), np.empty((npush, n, coefficients, columns))
    followed = np.zeros(npush, dtype=np.bool_)
    forces = (
        balance(None, lumps, gravity, joints=joints, is_continuous=trial.is_continuous),
        derivatives(unknowns, lumps, gravity),
    )
    readings = np.cumsum(trial.readings, axis=-1)
    settings = len(log_factors), extra, trial.substeps, trial.is_continuous

    def run(first: int, stride: int) -> None:
        room = workspace(n, columns, False, trial.is_continuous)
        for push in range(first, npush, stride):
            pushed, own = (starts[push], trial.forces[push], readings[push]), (led.gains[push], led.weights[push])
            moving = trial.timesteps[push], *settings
            shown = basis[push], steps[push], room, (values[push], slopes[push])
            followed[push] = watch_innovations(*pushed, *forces, moving, own, *shown)

    share_out(run, npush, int(steps.sum()) * trial.substeps * n * (4 * n + coefficients) * columns)
    return Coefficients(values, slopes) if followed.all() else None


def lead_chain(
    trial: ReadTrial,
    begun: tuple[Array, Array],
    pushes: NDArray[np.intp],
    unknowns: Unknowns,
    log_factors: Array,
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
        unknowns: what is unknown of the chain.
        log_factors: where it is (nunknown).
        gravity: in m/s².
        joints: what these have beside the lumps; None for nothing.
        torque_noise: standard deviation of the torque of each joint (njoint), in N m.
    """
    (starts, begins), (npush, readings, n) = begun, trial.readings.shape
    lumps = unknowns.lumps(log_factors)
    forces = balance(None, lumps, gravity, joints=joints, is_continuous=trial.is_continuous)
    links = np.tril(np.ones((n, n)))  # absolute angles are sums of the joints'
    torques = np.eye(n) - np.eye(n, k=1)  # the torque of a joint turns its link, and the one below the other way
    noise = (links * trial.noise**2) @ links.T, (torques * torque_noise**2) @ torques.T
    gains, weights = np.zeros((npush, readings, 2 * n, n)), np.zeros((npush, readings, n, n))
    states, sums = np.zeros((npush, readings, 2 * n)), np.zeros((npush, 2))
    both = np.kron(np.eye(2), links)
    covariances, seen = np.ascontiguousarray(both @ begins @ both.T), np.cumsum(trial.readings, axis=-1)
    nothing = derivatives(unknowns.alone(log_factors), lumps, gravity)
    settings = trial.substeps, trial.is_continuous, nothing

    def run(first: int, stride: int) -> None:
        room = workspace(n, 0, False, trial.is_continuous), spread_of(n)
        for push in pushes[first::stride].tolist():
            pushed, moving = (starts[push], covariances[push], trial.forces[push], seen[push]), trial.timesteps[push]
            own = gains[push], weights[push], states[push]
            sums[push] = lead(*pushed, forces, (moving, *settings), noise, trial.steps[push], *room, *own)

    share_out(run, len(pushes), int(trial.steps[pushes].sum()) * trial.substeps * 20 * n**3)
    squares, logarithm = sums.sum(axis=0)
    joint_states = np.diff(states.reshape(npush, readings, 2, n), axis=-1, prepend=0.0).reshape(states.shape)
    return Gains(gains, weights, joint_states, -0.5 * float(squares + logarithm))
