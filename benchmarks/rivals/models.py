"""What is believed of a rig, as every regression and every simulation needs it: linear in its parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from benchmarks.by_torque import inverse_dynamics_regressor
from benchmarks.recording import Recording
from benchmarks.rivals.servo import Followed, Sensors, Servo, follow
from metaid.models import Array, Chain, Lumps

TILT_UNIT, FRICTION_UNIT = 0.01, 0.01  # of unknowns of a descent that are no log factors, in rad and N m s


@dataclass(frozen=True)
class Motion(Recording):
    """A recording, and where joints slide to: `sliding` (nsample x njoint) passed the filter, as the torques did."""

    sliding: Array


class Model(Protocol):
    """A rig whose torque is linear in so many parameters (nparameter).

    A descent moves a point (nunknown) that means parameters, in units in which a step of 0.5 is long.
    """

    @property
    def njoint(self) -> int: ...

    @property
    def count(self) -> int: ...

    @property
    def prior(self) -> Array:
        """What is believed (nparameter x nparameter + 1, or nothing x nparameter + 1); see `regression.Rows`."""
        ...

    def regressor(self, motion: Motion) -> Array:
        """Joint torque for a unit of each parameter (nsample x njoint x nparameter)."""
        ...

    def kept(self, motion: Motion) -> Array:
        """1 where the torque of a joint is regressed (nsample x njoint), 0 where it is left out."""
        ...

    def follow(self, parameters: Array, servo: Servo, sensors: Sensors) -> Followed | None:
        """Its motion under a servo; None where no such rig can be."""
        ...

    def point(self, parameters: Array) -> Array:
        """The point (nunknown) of a model with these parameters."""
        ...

    def parameters_at(self, point: Array) -> Array:
        """The parameters (nparameter) that a point means."""
        ...


@dataclass(frozen=True)
class Columns:
    """Regression `parameters` (nparameter) in the order of the columns: gravity, Coriolis and inertia lumps, then,
    where they are searched, friction of each joint, in N m s, and of each link the gravity lump times the tilt.
    """

    parameters: Array
    nlink: int
    searched: tuple[str, ...]

    @property
    def lumps(self) -> Array:
        """Gravity and Coriolis lumps (nlump)."""
        return self.parameters[: self._pairs]

    @property
    def inertia(self) -> Array:
        """Inertia lumps (nlink)."""
        return self.parameters[self._pairs : self._pairs + self.nlink]

    @property
    def friction(self) -> Array:
        """Of each joint (njoint), in N m s."""
        first = self._pairs + self.nlink
        return self.parameters[first : first + self.nlink] if "friction" in self.searched else np.zeros(self.nlink)

    @property
    def tilt(self) -> float:
        """Of the base, in rad: what explains its columns best."""
        weight = self.lumps[: self.nlink]
        return float(self.parameters[-self.nlink :] @ weight / (weight @ weight)) if "tilt" in self.searched else 0.0

    @property
    def chain(self) -> Lumps:
        """The chain that they are."""
        n = self.nlink
        coriolis = np.zeros((n, n))
        coriolis[np.triu_indices(n, 1)] = self.lumps[n:]
        return Lumps(self.lumps[:n], coriolis + coriolis.T, damping=self.friction, inertia=self.inertia)

    @property
    def _pairs(self) -> int:
        return self.nlink * (self.nlink + 1) // 2


@dataclass(frozen=True)
class ChainModel:
    """A planar chain, of which the `nominal` one is believed, with `gravity` in m/s² and the `timestep` in s. Its
    parameters are those of `Columns`; "friction" and "tilt" may be `searched`.
    """

    nominal: Chain
    gravity: float
    timestep: float
    searched: tuple[str, ...] = ()

    @property
    def njoint(self) -> int:
        return self.nominal.nlink

    @property
    def count(self) -> int:
        further = sum(kind in self.searched for kind in ("friction", "tilt"))
        return len(self.believed) + further * self.njoint

    @property
    def prior(self) -> Array:
        return np.empty((0, self.count + 1))

    @property
    def believed(self) -> Array:
        """The nominal lumps (nlump + nlink), those of inertia included."""
        return np.append(self.nominal.lumps.vector, self.nominal.inertia_lumps)

    def columns(self, parameters: Array) -> Columns:
        """What parameters say."""
        return Columns(parameters, self.njoint, self.searched)

    def regressor(self, motion: Motion) -> Array:
        parts = [inverse_dynamics_regressor(motion.angles, motion.speeds, motion.accelerations, self.gravity)]
        if "friction" in self.searched:
            parts.append(motion.speeds[:, :, None] * np.eye(self.njoint))
        if "tilt" in self.searched:
            parts.append(self.turned(motion.angles))
        return np.concatenate(parts, axis=2)

    def kept(self, motion: Motion) -> Array:
        return np.ones_like(motion.angles)

    def turned(self, angles: Array) -> Array:
        """Joint torque (nsample x njoint x nlink) for each gravity lump times the angle by which its link is turned
        beyond joint `angles` (nsample x njoint): sin(φ + t) is sin φ + t cos φ.
        """
        links = np.arange(self.njoint)
        force = -self.gravity * np.cos(np.cumsum(angles, axis=1))
        return np.asarray(np.where(links[:, None] <= links, force[:, None, :], 0.0))

    def follow(self, parameters: Array, servo: Servo, sensors: Sensors) -> Followed | None:
        columns = self.columns(parameters)
        if not np.all(columns.inertia > 0.0):
            return None
        return follow(columns.chain, self.gravity, self.timestep, servo, sensors.tilted(columns.tilt))

    def point(self, parameters: Array) -> Array:
        """Log factors of the nominal lumps, 0 where one is not above 0; then friction and tilt."""
        columns = self.columns(parameters)
        factors = np.append(columns.lumps, columns.inertia) / self.believed
        parts = [np.log(np.where(factors > 0.1, factors, 1.0))]
        if "friction" in self.searched:
            parts.append(columns.friction / FRICTION_UNIT)
        if "tilt" in self.searched:
            parts.append(np.array([columns.tilt / TILT_UNIT]))
        return np.concatenate(parts)

    def parameters_at(self, point: Array) -> Array:
        n, count = self.njoint, len(self.believed)
        parts = [self.believed * np.exp(point[:count])]
        if "friction" in self.searched:
            parts.append(FRICTION_UNIT * point[count : count + n])
        if "tilt" in self.searched:
            parts.append(TILT_UNIT * point[-1] * parts[0][:n])
        return np.concatenate(parts)
