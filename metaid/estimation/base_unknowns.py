"""What is unknown of an arm, its base parameters as steps along their prior (Eq. 60), and what all trials
say of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from metaid.estimation.estimate import Found
from metaid.models import COARSEST, DEVIATIONS, Array
from metaid.models.tree import (
    PARAMETERS,
    ArmPrior,
    Tree,
    joint_torque,
    last_link_turned,
    misplaced,
    nearest_possible,
    possible_bodies,
    random_states,
    torque_half_width,
    torque_rows,
)

if TYPE_CHECKING:
    from metaid.compiled.spatial import Frames

ROTOR = PARAMETERS.index("rotor")
GEARED = 0.1  # standard deviations of a rotor's inertia
LEAST_GAIN = 1e-3  # of cost: dry friction makes it uneven, and a descent would feel its way to no avail
POSES = 64  # at which torques are looked at
SPREAD = 0.3  # of an unknown: a descent takes steps of as much as of a chain's log factors


@dataclass(frozen=True, eq=False)
class BaseUnknowns:
    """The unknowns z (nbase) of an arm: its base parameters are β₀ + S z, of which `prior` has β₀ and S. Where `known`
    has them all (nbase), nothing is unknown any more. Joints are where the nominal arm has them, or the one `moved`.
    """

    prior: ArmPrior
    spread: float = SPREAD
    known: Array | None = None
    moved: Tree | None = None

    kinds: ClassVar[tuple[str, ...]] = ("damping", "coulomb", "rotor")  # these are among the base parameters
    builds_up: ClassVar[bool] = True
    tilts: ClassVar[int] = 2  # a base turns about two horizontal axes
    leads_on: ClassVar[bool] = True
    ends_when_cut: ClassVar[bool] = False  # near a singular mass matrix steps are cut, and lead to a wrong minimum
    least_gain: ClassVar[float] = LEAST_GAIN
    rounding: ClassVar[float] = 1e-7
    scale: ClassVar[float] = SPREAD

    @property
    def names(self) -> list[str]:
        """Of the base parameters (nbase), of which there are as many as unknowns; none where they are known."""
        return [] if self.known is not None else list(self.prior.base.names)

    @property
    def njoint(self) -> int:
        return self.prior.nominal.njoint

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(self.prior.nominal.names)

    @cached_property
    def frames(self) -> Frames:
        """Where the joints are."""
        from metaid.compiled.spatial import frames_of  # loads numba

        return frames_of(self.moved or self.prior.nominal)

    @cached_property
    def root(self) -> Array:
        """S (nbase x nbase): unknowns that are independent, of standard deviation `spread`, make the prior.

        Eq. 60.
        """
        return np.asarray(self.prior.root / self.spread)

    @cached_property
    def begin(self) -> Array:
        """The unknowns (nbase) of the nominal arm with heavier rotors: a share of what their inertia may be more.

        Its mass matrix is far from singular, so a descent that begins there is less often led to where it is.
        """
        parameters = self.prior.nominal.parameters.copy()
        variances = np.diag(self.prior.parameter_covariance).reshape(parameters.shape)
        parameters[:, ROTOR] += GEARED * np.sqrt(variances[:, ROTOR])
        return self._by_change(self.prior.base.of(parameters) - self.prior.values)

    def _by_change(self, change: Array) -> Array:
        """By how much the unknowns (nbase) change where base parameters do (nbase)."""
        return np.asarray(np.linalg.lstsq(self.root, change, rcond=None)[0], dtype=np.float64)

    def values(self, unknowns: Array) -> Array:
        """The base parameters (... x nbase)."""
        return np.asarray(self.prior.values + unknowns @ self.root.T, dtype=np.float64)

    def parameters(self, unknowns: Array) -> Array:
        """The most probable parameters of every joint and its link (... x njoint x 13)."""
        if self.known is not None:
            unknowns = np.broadcast_to(self.known, (*unknowns.shape[:-1], len(self.known)))
        return np.ascontiguousarray(self.prior.parameters_at(self.values(unknowns)))

    def alone(self, unknowns: Array) -> BaseUnknowns:
        return replace(self, known=unknowns)

    def misplaced(self, unknowns: Array, step: float) -> Iterator[tuple[int, BaseUnknowns, float]]:
        for joint, moved, deviation in misplaced(self.prior.nominal, step):
            yield joint, replace(self, known=unknowns, moved=moved), deviation

    def hides_offset(self, unknowns: Array) -> Array | None:
        """See `Unknowns`: an arm whose last link is turned as far moves alike."""
        tree = self.prior.nominal
        if tree.slides[-1]:
            return None
        return self._by_change(self.prior.base.of(last_link_turned(tree, self.parameters(unknowns))))

    def nearest(self, unknowns: Array, covariance: Array) -> Array | None:
        """See `Unknowns`: those of possible bodies.  Eq. 69."""
        if possible_bodies(self.prior, self.values(unknowns)) is not None:
            return None
        inverse = np.linalg.pinv(self.root)
        precision = inverse.T @ np.linalg.inv(covariance) @ inverse
        values = nearest_possible(self.prior, self.values(unknowns), precision)
        return np.asarray(inverse @ (values - self.prior.values), dtype=np.float64)

    def torques(self, speed: float) -> Array:
        states = random_states(self.prior.nominal, 0, POSES)[0]
        rest, each = np.zeros_like(states), np.full_like(states, speed**2)
        needed = joint_torque(self.prior.nominal, states, rest, each)
        held = joint_torque(self.prior.nominal, states, rest, rest)
        return np.asarray(np.abs(np.concatenate([needed, held])).max(axis=0), dtype=np.float64)

    @property
    def inertia(self) -> Array:
        """About what each joint needs (njoint) to be held and accelerated by 1 rad/s² or m/s²."""
        return self.torques(1.0)

    def estimated(self, **found: Any) -> ArmEstimate:
        return ArmEstimate(**found, searched=self)


@dataclass(frozen=True, kw_only=True)
class ArmEstimate(Found):
    """What all trials say of an arm, whose base parameters are those of what was `searched`.

    `names` are the base parameters'; `unknowns` and `covariance` are of the z of Eq. 60.
    """

    searched: BaseUnknowns

    lacks = "springs, play, torques that come late or are cut off, or wrong frames"
    share_of = "what was not known"

    @property
    def values(self) -> Array:
        """The base parameters (nbase)."""
        return self.searched.values(self.unknowns)

    @property
    def parameters(self) -> Array:
        """The most probable parameters of every joint and its link (njoint x 13): the law that is to be sent next."""
        return self.searched.parameters(self.unknowns)

    @property
    def to_numbers(self) -> Array:
        return self.searched.root

    @property
    def beforehand(self) -> Array:
        """Standard deviation of each base parameter (nbase), beforehand."""
        return np.sqrt(np.diag(self.searched.prior.covariance))

    @property
    def sizes(self) -> Array:
        """What changes of each base parameter (nbase) are large or small beside."""
        return np.maximum(np.abs(self.values), self.beforehand)

    @property
    def coarsest(self) -> Array:
        return np.asarray(COARSEST * self.sizes, dtype=np.float64)

    def torques(self, numbers: Array) -> Array:
        prior = self.searched.prior
        return np.moveaxis(torque_rows(prior.nominal, prior.base) @ (prior.values + numbers).T, -1, 0)

    @property
    def is_possible(self) -> bool:
        """Whether there are bodies that have what was found."""
        return possible_bodies(self.searched.prior, self.values) is not None

    def interval_with(self, deviations: Array) -> tuple[Array, Array]:
        reach = DEVIATIONS * deviations
        return self.values - reach, self.values + reach

    def half_width_with(self, covariance: Array) -> float:
        """Half the widest interval that holds the torque of each joint, as a share of it; see `torque_half_width`."""
        prior = self.searched.prior
        return torque_half_width(prior.nominal, prior.base, self.values, covariance)

    def shares(self, true: Array | None) -> tuple[Array, Array | None]:
        errors = None if true is None else np.abs(self.values - true) / self.beforehand
        return self.value_deviations / self.beforehand, errors

    def in_words(self, changes: Array) -> str:
        base, moved = self.searched.prior.base, int(np.argmax(np.abs(changes) / self.sizes))
        way = "larger" if changes[moved] > 0.0 else "smaller"
        return f"{base.names[moved]} would be {abs(changes[moved]):.2g} {base.units[moved]} {way}"
