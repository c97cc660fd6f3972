"""What the simulated twin of a robot shows of a trial on exact sensors, and a filter that leads it through others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import Run, likelihood_about
from metaid.estimation.trials import Gains
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
        run: through all of them, by the variances of the torques (1 x njoint), and by whether its steps are kept.
        of_reading: covariance of a reading (njoint x njoint).
        begins: covariance of the states at the starts (npush x 2 njoint x 2 njoint).
        steps: for how many each push is followed (npush).
        pushes: their numbers.
        joints: coordinates and speeds of joints, by states.
    """

    run: Callable[[Array, bool], Run]
    of_reading: Array
    begins: Array
    steps: NDArray[np.int64]
    pushes: NDArray[np.intp]
    joints: Callable[[Array], Array]

    def gains(self, torque_noise: Array) -> Gains:
        """Where the noise of each joint's torque has these standard deviations (njoint), in N m or N."""
        found = self.run(torque_noise[None] ** 2, False)
        return Gains(found.gains, found.weights, self.joints(found.states), -0.5 * float(found.sums.sum()))

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
