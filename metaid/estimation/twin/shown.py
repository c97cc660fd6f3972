"""What the simulated twin of a robot shows of a trial on exact sensors, and a filter that leads it through others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import Filtered, likelihood_about
from metaid.episode import energies
from metaid.estimation.trials import WatchedTrial
from metaid.models import Array

UNASKED = np.empty(0)


class Shown(NamedTuple):
    """What the twin shows of one trial on exact sensors.

    Attributes:
        angles: of the joints at the ends of windows (npush x nwindow x njoint).
        speeds: likewise.
        angle_slopes: derivatives of the first by the unknowns (npush x nwindow x njoint x nunknown).
        speed_slopes: of the second.
        reached: how many windows of each push the twin got through (npush).
        speed_energy: ∫ q̇² dt of each joint up to there (npush x nwindow x njoint), where it is asked for.
        acceleration_energy: ∫ (q̈ + k q)² dt, likewise.
        speed_energy_slopes: derivatives of the first (npush x nwindow x njoint x nunknown).
        acceleration_energy_slopes: of the second.
    """

    angles: Array
    speeds: Array
    angle_slopes: Array
    speed_slopes: Array
    reached: NDArray[np.int64]
    speed_energy: Array = UNASKED
    acceleration_energy: Array = UNASKED
    speed_energy_slopes: Array = UNASKED
    acceleration_energy_slopes: Array = UNASKED

    def windows_reached(self, ends: NDArray[np.int64]) -> NDArray[np.int64]:
        """How many windows with these `ends` (nwindow) were, where the motion is shown at every step from 0 on."""
        return np.searchsorted(ends, self.reached - 1, side="right")


def with_energies(every: Shown, trial: WatchedTrial, ends: NDArray[np.int64]) -> Shown:
    """The motion at the `ends` of windows (nwindow), in steps, with energies, by that at `every` step from 0 on."""
    angles, speeds, by_angle, by_speed = (each.swapaxes(0, 1) for each in every[:4])
    timestep, pull = trial.timestep, np.broadcast_to(trial.stiffness, len(trial.starts))[:, None]
    shown = energies(speeds, timestep, -pull * angles[:-1])[:, ends].swapaxes(1, 2)
    jumps = np.diff(speeds, axis=0) + timestep * pull * angles[:-1]  # Eq. 14
    by_pull = timestep * pull[..., None] * _summed(jumps, by_angle, ends)
    of_jumps = (2.0 / timestep) * (_summed(jumps, np.diff(by_speed, axis=0), ends) + by_pull)
    at_ends = speeds[ends][..., None] * by_speed[ends]
    of_speeds = timestep * (2.0 * _summed(speeds[1:], by_speed[1:], ends) - at_ends)  # by trapezoids
    slopes = (each.swapaxes(0, 1) for each in (of_speeds, of_jumps))
    angles, speeds, by_angle, by_speed = (each[:, ends] for each in every[:4])
    return Shown(angles, speeds, by_angle, by_speed, every.windows_reached(ends), *shown, *slopes)


def _summed(one: Array, slopes: Array, ends: NDArray[np.int64]) -> Array:
    """The sums of products with `slopes` (nstep x npush x njoint x nunknown) over the steps before each of `ends`."""
    steps = pairwise([0, *ends.tolist()])
    parts = [np.einsum("tpi,tpiu->piu", one[first:last], slopes[first:last]) for first, last in steps]
    return np.cumsum(parts, axis=0)


@dataclass(frozen=True)
class Filter:
    """A filter through some pushes of a trial, in whichever coordinates the twin has.

    Attributes:
        run: through all of them, by the variances of the torques (1 x njoint), and by whether its steps are kept.
        of_reading: covariance of a reading (njoint x njoint).
        begins: covariance of the states at the starts (npush x 2 njoint x 2 njoint).
        steps: for how many each push is followed (npush).
        pushes: their numbers.
        joints: coordinates and speeds of joints, by states.
    """

    run: Callable[[Array, bool], Filtered]
    of_reading: Array
    begins: Array
    steps: NDArray[np.int64]
    pushes: NDArray[np.intp]
    joints: Callable[[Array], Array]

    def gains(self, torque_noise: Array) -> Filtered:
        """Where the noise of each joint's torque has these standard deviations (njoint), in N m or N; with the states
        of joints, coordinates before speeds.
        """
        found = self.run(torque_noise[None] ** 2, False)
        return found._replace(states=self.joints(found.states))

    def likelihood_about(self, torque_noise: Array) -> Callable[[Array, slice], Array]:
        """The logarithm of the likelihood of some of the pushes, but for a constant, by several standard deviations
        (ncase x njoint) near these (njoint), in N m or N (ncase): all by steps that are linearised along one run.
        Eq. 37.
        """
        run = self.run(torque_noise[None] ** 2, True)
        if not np.isfinite(run.sums).all():
            return lambda cases, _: np.full(len(cases), np.nan)

        def likelihood(cases: Array, some: slice) -> Array:
            return likelihood_about(run, self.begins, (self.of_reading, cases**2), self.steps, self.pushes[some])

        return likelihood
