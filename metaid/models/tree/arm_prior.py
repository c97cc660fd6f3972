"""The prior of an arm, before anything is seen of it, and what follows from base parameters for all parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from metaid.errors import EpisodeError, unknown
from metaid.models.lumps import Array
from metaid.models.tree.base import NOTHING, BaseParameters, base_parameters, random_states, shown_by
from metaid.models.tree.regressor import BODY, joint_torque
from metaid.models.tree.tree import PARAMETERS, UPPER, Tree

LEAST_LEVER = 0.01  # m, of a centre of mass that is said to be on the joint
ROUNDING = 1e-6  # of a standard deviation: what is left of one that is none
LEAST_SHARE = 0.1  # of the strongest joint's torque, for a joint that needs next to none


@dataclass(frozen=True)
class PriorDeviations:
    """How wrong a nominal arm may be: standard deviations.

    Attributes:
        mass: of each link, as a share of it.
        com: of a coordinate of its centre of mass, as a share of its distance from the joint's origin.
        inertia: of its moments of inertia about the centre of mass, as a share of them.
        rotor: of a rotor's inertia, as what the torque of the joint would accelerate by 10 rad/s².
        damping: of viscous friction, as a share of the torque of the joint in 1 rad/s.
        coulomb: of dry friction, as a share of the torque of the joint.

    The torque of a joint is what the nominal arm needs in the mean, at accelerations of about 10 rad/s².
    """

    mass: float = 0.3
    com: float = 0.15
    inertia: float = 0.3
    rotor: float = 1.0
    damping: float = 0.5
    coulomb: float = 0.3


@dataclass(frozen=True)
class ArmPrior:
    """A `nominal` arm and how wrong it may be.

    Its base parameters are `counted_by` those of these names (nbase), by default by any that are independent; where the
    base `tilts`, there are more.
    """

    nominal: Tree
    deviations: PriorDeviations = PriorDeviations()
    counted_by: tuple[str, ...] | None = None
    tilts: bool = False

    @property
    def njoint(self) -> int:
        return self.nominal.njoint

    @property
    def law(self) -> Array:
        """The nominal parameters (njoint x 13)."""
        return self.nominal.parameters

    def law_of(self, values: Array) -> Array:
        """The parameters (njoint x 13) of the candidate with these base parameters (nbase).  Raises EpisodeError where
        they are none.
        """
        checked = np.asarray(values, dtype=np.float64)
        if checked.shape != self.values.shape or not np.isfinite(checked).all():
            raise EpisodeError(
                f"these are no base parameters (allowed: {len(self.values)} finite numbers, one for each)"
            )
        return self.parameters_at(checked)

    def laws_of(self, values: Array) -> Array:
        """The same of many candidates (ncandidate x nbase), each to the last bit what it is by itself."""
        return np.array([self.law_of(each) for each in values])

    @cached_property
    def base(self) -> BaseParameters:
        """The combinations that a torque can tell."""
        return base_parameters(self.nominal, self.counted_by, self.tilts)

    @cached_property
    def values(self) -> Array:
        """The nominal base parameters (nbase)."""
        return self.base.of(self.nominal.parameters)

    def scaled(self, factors: Mapping[str, float]) -> Array:
        """The nominal base parameters (nbase) times `factors` by name; `all` is of all of them.  Raises EpisodeError
        where there are none of that name.
        """
        names = self.base.names
        for name in factors:
            if name not in (*names, "all"):
                raise EpisodeError(unknown("base parameter", name, ["all", *names]))
        each = np.array([factors.get(name, 1.0) for name in names])
        return np.asarray(self.values * factors.get("all", 1.0) * each, dtype=np.float64)

    @cached_property
    def parameter_covariance(self) -> Array:
        """W, of all parameters (13 njoint x 13 njoint).  Eq. 54."""
        tree, deviations = self.nominal, self.deviations
        size = len(PARAMETERS)
        covariance = np.zeros((tree.njoint, size, tree.njoint, size))
        for i, scale in enumerate(self._torques):
            joint = np.array([0.1 * deviations.rotor, deviations.damping, deviations.coulomb]) * scale
            covariance[i, :BODY, i, :BODY] = _of_body(tree, i, deviations)
            covariance[i, BODY:, i, BODY:] = np.diag(joint**2)
        return covariance.reshape(tree.njoint * size, tree.njoint * size)

    @cached_property
    def covariance(self) -> Array:
        """Of the base parameters (nbase x nbase)."""
        return np.asarray(self.base.matrix @ self.parameter_covariance @ self.base.matrix.T, dtype=np.float64)

    @cached_property
    def root(self) -> Array:
        """S (nbase x nbase): base parameters are β₀ + S z, with z independent and of standard deviation 1.  Eq. 60.

        What torques show of a tilted base alone comes last, by itself: beside what others show, the inverse of the
        information would lose it to rounding.
        """
        scale = np.sqrt(np.diag(self.covariance))
        correlation, turned = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        root = np.asarray(scale[:, None] * turned * np.sqrt(np.maximum(correlation, 0.0)))
        if not self.tilts:
            return root
        _, singular, right = np.linalg.svd(shown_by(self.nominal, self.base.columns) @ root)
        root, hidden = root @ right.T, int((singular <= NOTHING * singular[0]).sum())
        last = root[:, len(root) - hidden :]
        last[np.abs(last) < ROUNDING * scale[:, None]] = 0.0
        return np.asarray(root)

    @cached_property
    def gain(self) -> Array:
        """What the most probable parameters change by with each base parameter (13 njoint x nbase)."""
        across = self.parameter_covariance @ self.base.matrix.T
        scale = np.sqrt(np.diag(self.covariance))
        whitened = np.linalg.pinv(self.covariance / np.outer(scale, scale), rcond=1e-13, hermitian=True)
        return np.asarray((across / scale) @ whitened / scale, dtype=np.float64)

    def parameters_at(self, values: Array) -> Array:
        """The most probable parameters (... x njoint x 13) of arms with these base parameters (... x nbase).  Eq. 55.

        They need not be those of bodies that can be.
        """
        nominal, columns = self.nominal.parameters, self.base.columns
        parameters = nominal.ravel() + (values - self.values) @ self.gain.T
        parameters[..., columns] += values - parameters @ self.base.matrix.T  # what rounding left
        return np.asarray(parameters.reshape(*values.shape[:-1], *nominal.shape), dtype=np.float64)

    def tree_at(self, values: Array) -> Tree:
        """The most probable arm with these base parameters (nbase)."""
        return self.nominal.with_parameters(self.parameters_at(values))

    @cached_property
    def _torques(self) -> Array:
        """What the nominal joints need in random states, root mean square (njoint), in N m or N."""
        needed = joint_torque(self.nominal, *random_states(self.nominal, 1))
        torques = np.sqrt((needed**2).mean(axis=0))
        return np.asarray(np.maximum(torques, LEAST_SHARE * torques.max()), dtype=np.float64)


def _of_body(tree: Tree, link: int, apart: PriorDeviations) -> Array:
    """The covariance of the ten parameters of a link, whose mass, centre of mass and inertia are independent."""
    mass, com, inertia = tree.mass[link], tree.com[link], tree.inertia[link]
    moments = np.diag(inertia)
    sizes = np.sqrt(np.outer(moments, moments)) * np.where(np.eye(3) > 0.0, 1.0, 0.5)
    lever = max(float(np.linalg.norm(com)), LEAST_LEVER)
    deviations = np.concatenate([[apart.mass * mass], np.full(3, apart.com * lever), apart.inertia * sizes[UPPER]])
    # How m, m c and the inertia about the origin change with m, c and that about the centre of mass.
    change = np.eye(BODY)
    change[1:4, 0], change[1:4, 1:4] = com, mass * np.eye(3)
    change[4:, 0] = (com @ com * np.eye(3) - np.outer(com, com))[UPPER]
    for axis, unit in enumerate(np.eye(3)):
        spread = 2.0 * com[axis] * np.eye(3) - np.outer(unit, com) - np.outer(com, unit)
        change[4:, 1 + axis] = mass * spread[UPPER]
    rows = change * deviations
    return np.asarray(rows @ rows.T, dtype=np.float64)
