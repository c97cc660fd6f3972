"""The simulated twin of a robot, as what is compared sees it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import Run, likelihood_about
from metaid.estimation.trials import Coefficients, Driven, Filtered, Gains, Joints, WatchedTrial
from metaid.models import Array


@dataclass(frozen=True)
class Motion:
    """What the twin shows of one trial on exact sensors.

    Attributes:
        speeds: of the joints at the ends of windows (npush x nwindow x njoint).
        speed_slopes: their derivatives by the unknowns (npush x nwindow x njoint x nunknown).
        speed_energy: ∫ q̇² dt of each joint up to there (npush x nwindow x njoint), where it is asked for.
        acceleration_energy: ∫ (q̈ + k q)² dt, likewise.
        speed_energy_slopes: derivatives of the first (npush x nwindow x njoint x nunknown).
        acceleration_energy_slopes: of the second.
        reached: how many windows of each push the twin got through (npush).
    """

    speeds: Array
    speed_slopes: Array
    speed_energy: Array
    acceleration_energy: Array
    speed_energy_slopes: Array
    acceleration_energy_slopes: Array
    reached: NDArray[np.int64]


@dataclass(frozen=True)
class Filter:
    """A filter through some pushes of a trial, in whichever coordinates the twin has.

    Attributes:
        run: through all of them, by the covariances of a reading and of the forces of a step, and by whether its steps
            are kept.
        of_reading: the first of these (njoint x njoint).
        forces: of the torques (njoint x njoint).
        begins: covariance of the states at the starts (npush x 2 njoint x 2 njoint).
        steps: for how many each push is followed (npush).
        pushes: their numbers.
        joints: coordinates and speeds of joints, by states.
    """

    run: Callable[[tuple[Array, Array], bool], Run]
    of_reading: Array
    forces: Array
    begins: Array
    steps: NDArray[np.int64]
    pushes: NDArray[np.intp]
    joints: Callable[[Array], Array]

    def gains(self, torque_noise: Array) -> Gains:
        """Where the noise of each joint's torque has these standard deviations (njoint), in N m or N."""
        found = self.run(self._noise(torque_noise), False)
        return Gains(found.gains, found.weights, self.joints(found.states), -0.5 * float(found.sums.sum()))

    def likelihood_about(self, torque_noise: Array) -> Callable[[Array], float]:
        """The logarithm of the likelihood of what is filtered, but for a constant, by standard deviations near these
        (njoint), in N m or N: all by steps that are linearised along one run.  Eq. 37.
        """
        run = self.run(self._noise(torque_noise), True)
        if not np.isfinite(run.sums).all():
            return lambda _: float("nan")
        return lambda other: likelihood_about(run, self.begins, self._noise(other), self.steps, self.pushes)

    def _noise(self, torque_noise: Array) -> tuple[Array, Array]:
        return self.of_reading, np.ascontiguousarray((self.forces * torque_noise**2) @ self.forces.T)


class Twin(Protocol):
    """A robot with some unknowns, simulated. The derivatives of what it shows are by these, by what is further unknown
    of a trial, and by what is of its starts, in this order.
    """

    def watch(self, trial: WatchedTrial, windows: int, /, energies: bool = False) -> Motion:
        """The first so many `windows` of each push of a trial, under the same law; with `energies` and their
        derivatives, where it has them.
        """

    def trace(self, trial: WatchedTrial, steps: NDArray[np.int64], /) -> tuple[Array, NDArray[np.bool_]]:
        """Joint coordinates after so many `steps` of each push of a trial (npush x nsteps x njoint), under the same
        law, and whether the push was seen so far and the twin got there (npush x nsteps).
        """

    def drive(self, driven: Driven, joints: Joints | None, /, led: Gains | None = None) -> Coefficients | None:
        """What it shows of a noisy trial, driven by what was commanded; None where it cannot follow.

        Args:
            driven: the trial.
            joints: what they have beside the parameters; None for nothing.
            led: gains of a filter that sets it right by the readings. The coefficients are then those of the whitened
                innovations.
        """

    def lead(self, filtered: Filtered, joints: Joints | None, /) -> Filter:
        """A filter through some pushes of a trial (Eq. 35), with what `joints` have beside the parameters."""
