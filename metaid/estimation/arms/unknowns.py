"""What is unknown of an arm: its base parameters, as steps along what is believed of them (Eq. 51)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from metaid.models import Array
from metaid.models.tree import PARAMETERS, Belief

if TYPE_CHECKING:
    from metaid.compiled.arms import Frames

ROTOR = PARAMETERS.index("rotor")
GEARED = 0.1  # standard deviations of a rotor's inertia
SPREAD = 0.3  # of an unknown: a descent takes steps of as much as of a chain's log factors


@dataclass(frozen=True, eq=False)
class ArmUnknowns:
    """The unknowns z (nbase) of an arm: its base parameters are β₀ + S z, of which `belief` has β₀ and S."""

    belief: Belief
    spread: float = SPREAD

    @property
    def names(self) -> list[str]:
        """Of the base parameters (nbase), of which there are as many as unknowns."""
        return list(self.belief.base.names)

    @cached_property
    def frames(self) -> Frames:
        """Where the joints are."""
        from metaid.compiled.arms import frames_of  # loads numba

        return frames_of(self.belief.nominal)

    @cached_property
    def root(self) -> Array:
        """S (nbase x nbase): unknowns that are independent, of standard deviation `spread`, make what is believed.

        Eq. 51.
        """
        return np.asarray(self.belief.root / self.spread)

    @cached_property
    def geared(self) -> Array:
        """The unknowns (nbase) of the nominal arm with heavier rotors: a share of what their inertia may be more.

        Its mass matrix is far from singular, so a descent that begins there is less often led to where it is.
        """
        parameters = self.belief.nominal.parameters.copy()
        variances = np.diag(self.belief.parameter_covariance).reshape(parameters.shape)
        parameters[:, ROTOR] += GEARED * np.sqrt(variances[:, ROTOR])
        change = self.belief.base.of(parameters) - self.belief.values
        return np.asarray(np.linalg.lstsq(self.root, change, rcond=None)[0], dtype=np.float64)

    def values(self, unknowns: Array) -> Array:
        """The base parameters (... x nbase)."""
        return np.asarray(self.belief.values + unknowns @ self.root.T, dtype=np.float64)

    def parameters(self, unknowns: Array) -> Array:
        """The most probable parameters of every joint and its link (... x njoint x 13)."""
        return np.ascontiguousarray(self.belief.parameters_at(self.values(unknowns)))


class ComparedOfArm:
    """What all that is compared of an arm has in common."""

    @property
    def ends_when_cut(self) -> bool:
        """Near a singular mass matrix steps are cut, and a descent that ends there is led to a wrong minimum."""
        return False
