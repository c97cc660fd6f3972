"""What all trials of a study say of an arm."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from metaid.estimation.arms.unknowns import ArmUnknowns
from metaid.estimation.fit import Fit
from metaid.models import DEVIATIONS, Array
from metaid.models.tree import TreeModel


@dataclass(frozen=True)
class ArmEstimate(Fit):
    """What all trials say of an arm, whose base parameters are those of what was `searched`.

    `names` are the base parameters'; `unknowns` and `covariance` are of the z of Eq. 51.
    """

    searched: ArmUnknowns

    @property
    def values(self) -> Array:
        """The base parameters (nbase)."""
        return self.searched.values(self.unknowns)

    @property
    def parameters(self) -> Array:
        """The most probable parameters of every joint and its link (njoint x 13): the law that is to be sent next."""
        return self.searched.parameters(self.unknowns)

    @property
    def model(self) -> TreeModel:
        """The arm."""
        return TreeModel(self.searched.belief, self.values)

    @cached_property
    def value_covariance(self) -> Array:
        """Of the base parameters (nbase x nbase)."""
        return np.asarray(self.searched.root @ self.covariance @ self.searched.root.T, dtype=np.float64)

    @property
    def value_deviations(self) -> Array:
        """Standard deviation of each base parameter (nbase), in its unit."""
        return np.sqrt(np.diag(self.value_covariance))

    @property
    def left_unknown(self) -> Array:
        """Which share of what was not known beforehand of each base parameter the trials left unknown (nbase): 1 where
        they tell nothing.
        """
        return self.value_deviations / np.sqrt(np.diag(self.searched.belief.covariance))

    def interval(self, deviations: float = DEVIATIONS) -> tuple[Array, Array]:
        """Least and largest base parameters (nbase) within so many standard `deviations`: 95 % of them by default."""
        reach = deviations * self.value_deviations
        return self.values - reach, self.values + reach
