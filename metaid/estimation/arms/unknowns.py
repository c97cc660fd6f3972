"""What is unknown of an arm: its base parameters, as steps along what is believed of them (Eq. 51)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from metaid.estimation.trials import Joints
from metaid.models import Array
from metaid.models.tree import PARAMETERS, Belief, joint_torque, random_states

if TYPE_CHECKING:
    from metaid.compiled.arms import Frames
    from metaid.estimation.arms.arm_estimate import ArmEstimate
    from metaid.estimation.noisy.read_trial import Coefficients, Driven

ROTOR = PARAMETERS.index("rotor")
GEARED = 0.1  # standard deviations of a rotor's inertia
LEAST_GAIN = 1e-3  # of cost: dry friction makes it uneven, and a descent would feel its way to no avail
POSES = 64  # at which torques are looked at
SPREAD = 0.3  # of an unknown: a descent takes steps of as much as of a chain's log factors


@dataclass(frozen=True, eq=False)
class ArmUnknowns:
    """The unknowns z (nbase) of an arm: its base parameters are β₀ + S z, of which `belief` has β₀ and S. Where `known`
    has them all (nbase), nothing is unknown any more.
    """

    belief: Belief
    spread: float = SPREAD
    known: Array | None = None

    kinds: ClassVar[tuple[str, ...]] = ("damping", "coulomb")  # friction is among the base parameters
    tilts: ClassVar[int] = 2  # a base turns about two horizontal axes
    ends_when_cut: ClassVar[bool] = False  # near a singular mass matrix steps are cut, and lead to a wrong minimum
    least_gain: ClassVar[float] = LEAST_GAIN

    @property
    def names(self) -> list[str]:
        """Of the base parameters (nbase), of which there are as many as unknowns; none where they are known."""
        return [] if self.known is not None else list(self.belief.base.names)

    @property
    def njoint(self) -> int:
        return self.belief.nominal.njoint

    @property
    def joints(self) -> tuple[str, ...]:
        """What the joints are called (njoint)."""
        return tuple(self.belief.nominal.names)

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
    def begin(self) -> Array:
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
        if self.known is not None:
            unknowns = np.broadcast_to(self.known, (*unknowns.shape[:-1], len(self.known)))
        return np.ascontiguousarray(self.belief.parameters_at(self.values(unknowns)))

    def alone(self, unknowns: Array) -> ArmUnknowns:
        """The arm there, of which nothing is unknown any more."""
        return replace(self, known=unknowns)

    def torque(self, gravity: float, speed: float) -> float:
        """About what the joints need, in N m, at a `speed` in rad/s; the arm has its own gravity."""
        states = random_states(self.belief.nominal, POSES, np.random.default_rng(0))[0]
        rest, each = np.zeros_like(states), np.full_like(states, speed**2)
        needed = joint_torque(self.belief.nominal, states, rest, each)
        return float(np.abs(np.stack([needed, joint_torque(self.belief.nominal, states, rest, rest)])).max())

    def drive(
        self, driven: Driven, unknowns: Array, gravity: float, joints: Joints | None = None
    ) -> Coefficients | None:
        """The twin of a noisy trial, `driven` by what was commanded; None where it cannot follow.

        Args:
            driven: the trial.
            unknowns: of the arm (nunknown).
            gravity: that of the arm counts.
            joints: what these have beside the base parameters; None for nothing.
        """
        from metaid.estimation.arms.driven import drive_arm  # loads numba

        return drive_arm(driven, self, unknowns, joints)

    def estimated(self, found: dict[str, Any]) -> ArmEstimate:
        """The estimate with the fields of a `Fit` that were `found`."""
        from metaid.estimation.arms.arm_estimate import ArmEstimate  # which says what it is of

        return ArmEstimate(**found, searched=self)
