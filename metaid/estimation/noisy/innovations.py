"""What a fit compares where torques are noisy: the innovations of a filter that leads the twin by the readings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import compiled
from metaid.estimation.noisy.filtered import lead, spread_of, watch_innovations
from metaid.estimation.noisy.readings import Readings, started
from metaid.estimation.trials import Coefficients, Joints, ReadTrial
from metaid.estimation.twin import share_out
from metaid.estimation.unknowns import Unknowns
from metaid.estimation.workspace import balance, derivatives, workspace
from metaid.models import Array


@dataclass(frozen=True)
class Gains:
    """How a filter leads the twin through the pushes of one trial.

    Attributes:
        gains: of the state, absolute angles above speeds, by an innovation (npush x nstep + 1 x 2 njoint x njoint).
        weights: L⁻¹ with L Lᵀ the covariance of an innovation (npush x nstep + 1 x njoint x njoint), in 1/rad.
        states: the filter's, after each reading (npush x nstep + 1 x 2 njoint), in rad and rad/s.
        likelihood: the logarithm of that of the readings, but for a constant; NaN where the twin cannot follow.
    """

    gains: Array
    weights: Array
    states: Array
    likelihood: float


@dataclass(frozen=True, eq=False)
class Innovations(Readings):
    """The innovations of all `trials`, whitened, in the polynomials of Eq. 28, by a filter with given `gains` of each.

    A twin that is led by its readings does not lose the plant, so windows need not grow: the longest is the first.
    """

    unknowns: Unknowns
    gains: tuple[Gains, ...] = field(default=(), kw_only=True)

    @property
    def stages(self) -> int:
        return 1

    @property
    def is_led(self) -> bool:
        return True

    def _longest(self, number: int, windows: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return super()._longest(number, super().stages)

    def _left(
        self, number: int, trial: ReadTrial, starts: Array, windows: int, log_factors: Array, joints: Joints | None
    ) -> Coefficients | None:
        (chosen, steps), (_, basis) = self._longest(number, windows), self._windows[number]
        led, lumps = self.gains[number], self.unknowns.lumps(log_factors)
        (npush, _, n), coefficients = starts.shape, basis.shape[2]
        columns = len(log_factors) + (n if trial.start_spread is not None else 0)
        start_column = len(log_factors) if trial.start_spread is not None else -1
        values, slopes = np.empty((npush, n, coefficients)), np.empty((npush, n, coefficients, columns))
        followed = np.zeros(npush, dtype=np.bool_)
        forces = balance(None, lumps, self.gravity, joints=joints), derivatives(self.unknowns, lumps, self.gravity)
        speeds = np.ascontiguousarray(starts[:, 1])
        pushed = speeds, trial.forces, np.cumsum(trial.readings, axis=-1)
        settings = trial.timestep, start_column, trial.substeps
        compared = settings, (led.gains, led.weights), basis[chosen], steps

        def run(first: int, stride: int) -> None:
            room = workspace(n, columns, False)
            _watch_pushes(first, stride, pushed, *forces, *compared, room, (values, slopes, followed))

        share_out(run, npush, int(steps.sum()) * trial.substeps * n * (4 * n + coefficients) * columns)
        return Coefficients(values, slopes) if followed.all() else None

    def motion(self, number: int) -> tuple[Array, Array]:
        """As the filter has it: what noise of a torque does is seen in later readings alone. Were it in the speed of
        its own step already, as it is in speeds that later readings smooth, it would look like friction.
        """
        states, (npush, readings, n) = self.gains[number].states, self.trials[number].readings.shape
        joints = np.diff(states.reshape(npush, readings, 2, n), axis=-1, prepend=0.0)[:, :-1]
        going = (np.arange(readings - 1) < self.trials[number].steps[:, None])[..., None]
        return joints[:, :, 0] * going, joints[:, :, 1] * going

    def led(self, point: Array, torque_noise: Array) -> Innovations | None:
        """The same with the gains at a `point`, where torques of the joints have noise of these standard deviations
        (njoint), in N m; None where the twin cannot follow from there.
        """
        gains = tuple(self._lead(number, point, torque_noise) for number in range(len(self.trials)))
        return replace(self, gains=gains) if all(np.isfinite(each.likelihood) for each in gains) else None

    def likelihood(self, point: Array, torque_noise: Array, pushes: int) -> float:
        """The logarithm of the likelihood of the readings of about so many `pushes`, but for a constant, at a `point`,
        where torques of the joints have noise of these standard deviations (njoint), in N m.  Eq. 68.
        """
        each = -(-pushes // len(self.trials))
        return sum(self._lead(number, point, torque_noise, each).likelihood for number in range(len(self.trials)))

    def _lead(self, number: int, point: Array, torque_noise: Array, most: int | None = None) -> Gains:
        """The filter's gains in a trial. Where it is said of how `most` pushes, it is for their likelihood: then their
        start speeds are not those of the point, to which the noise of the torques has already led, but any.
        """
        unknowns, whitened = self._of_trial(number, point)
        log_factors, faults = self._parted(unknowns)
        trial = self._delivered(self.trials[number], faults)
        (npush, readings, n) = trial.readings.shape
        starts = np.ascontiguousarray(started(trial, whitened)[:, 1])
        forces = balance(None, self.unknowns.lumps(log_factors), self.gravity, joints=self._joints(faults))
        links = np.tril(np.ones((n, n)))  # absolute angles are sums of the joints'
        torques = np.eye(n) - np.eye(n, k=1)  # the torque of a joint turns its link, and the one below the other way
        noise = (links * trial.noise**2) @ links.T, (torques * torque_noise**2) @ torques.T
        gains, weights = np.zeros((npush, readings, 2 * n, n)), np.zeros((npush, readings, n, n))
        states = np.zeros((npush, readings, 2 * n))
        sums, begins = np.zeros((npush, 2)), np.zeros((npush, n, n))
        pushes = np.flatnonzero(trial.steps > 0)
        if most is not None:
            pushes = pushes[:: -(-len(pushes) // most) or 1]
            starts = trial.start_speeds
            if trial.start_spread is not None:
                begins = np.einsum("ij,pjk,plk,ml->pim", links, trial.start_spread, trial.start_spread, links)
        pushed = starts, begins, trial.forces, np.cumsum(trial.readings, axis=-1)
        settings = (trial.timestep, trial.substeps), noise, trial.steps

        def run(first: int, stride: int) -> None:
            room = workspace(n, 0, False), spread_of(n)
            _lead_pushes(pushes[first::stride], pushed, forces, *settings, *room, (gains, weights, states), sums)

        share_out(run, len(pushes), int(trial.steps[pushes].sum()) * trial.substeps * 20 * n**3)
        squares, logarithm = sums.sum(axis=0)
        return Gains(gains, weights, states, -0.5 * float(squares + logarithm))


@compiled
def _watch_pushes(first, stride, started, balance, derivatives, settings, led, bases, steps, work, seen):  # type: ignore[no-untyped-def]
    """Every `stride`-th push from the `first` on."""
    starts, forces, readings = started
    gains, weights = led
    values, slopes, followed = seen
    for push in range(first, starts.shape[0], stride):
        pushed, own = (starts[push], forces[push], readings[push]), (gains[push], weights[push])
        shown = bases[push], steps[push], work, (values[push], slopes[push])
        followed[push] = watch_innovations(*pushed, balance, derivatives, settings, own, *shown)


@compiled
def _lead_pushes(pushes, begun, balance, settings, noise, steps, work, spread, led, sums):  # type: ignore[no-untyped-def]
    """Each of the `pushes`; fills in the two sums of `lead` (npush x 2)."""
    starts, begins, forces, readings = begun
    gains, weights, states = led
    for push in pushes:
        pushed = starts[push], begins[push], forces[push], readings[push]
        own = gains[push], weights[push], states[push]
        found = lead(*pushed, balance, settings, noise, steps[push], work, spread, *own)
        sums[push, 0], sums[push, 1] = found
