"""What all trials of a study say of a robot: what every estimate has."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from metaid.estimation.faults import FoundFaults
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array


@dataclass(frozen=True, kw_only=True)
class Found:
    """What all trials say of a robot: numbers by their `names`, and values that follow from these. Those of a chain are
    its parameters, with log factors, and its lumps; those of an arm are its base parameters, both.

    Attributes:
        names: of what was unknown (nunknown); faults that were searched beside them come after these.
        unknowns: z (nunknown), the changes of the nominal model that show what was seen.
        covariance: of the unknowns (nunknown x nunknown).
        cost: half the sum of squares of the residuals, with that of the prior.
        misfit: root mean square of the residuals, scaled by what noise or rounding explains.
        explained_below: a misfit below this says that the model explains what was seen.
        iterations: steps of all descents.
        residuals: of each trial by push and joint (npush x njoint), root mean square over the windows.
        extras: the unknowns that concern one push alone (nextra): start speeds scaled by what pushes differ by, or
            none where these are read.
        searched: what was unknown of it.
        faults: that were searched beside that; None where none were.
        torque_noise: standard deviation of the noise of each joint's torque (njoint), in N m, that was found; None
            where none was looked for.
        led_misfit: the misfit of the twin that the readings lead, where noise of the torques stands for what the model
            has not, and `misfit` is that of the twin without it; None elsewhere.
        extent: least and largest log factor (2 x nvalue) of the models that show exactly the counts that were seen;
            None where no counts were compared, or no model shows them. Half of it is 1.96 times the deviation.
        counts: how many counts were compared, of which the misfit is the number that differs; None where none were.
    """

    names: tuple[str, ...]
    unknowns: Array
    covariance: Array
    cost: float
    misfit: float
    explained_below: float
    iterations: int
    residuals: tuple[Array, ...]
    extras: Array
    searched: Unknowns
    faults: FoundFaults | None = None
    torque_noise: Array | None = None
    led_misfit: float | None = None
    extent: Array | None = None
    counts: int | None = None

    lacks: ClassVar[str]  # what such models often lack, in words
    share_of: ClassVar[str]  # what `shares` are of

    @property
    def is_explained(self) -> bool:
        """Whether the model explains what was seen."""
        return self.misfit < self.explained_below

    @property
    def deviations(self) -> Array:
        """Standard deviation of each unknown (nunknown)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def to_numbers(self) -> Array:
        """How what the `names` name changes with the unknowns (nname x nunknown)."""
        return np.eye(len(self.unknowns))

    @property
    def to_values(self) -> Array:
        """How the values change with what the `names` name (nvalue x nname)."""
        return np.eye(len(self.unknowns))

    @property
    def values(self) -> Array:
        """(nvalue), in SI units."""
        raise NotImplementedError

    @property
    def coarsest(self) -> Array:
        """What a standard deviation of what the `names` name (nname) is at most where that is determined."""
        raise NotImplementedError

    @property
    def is_possible(self) -> bool:
        """Whether a plant can have what was found."""
        raise NotImplementedError

    def torques(self, numbers: Array) -> Array | None:
        """The joint torques of an arm in random states (n x nstate x njoint) where what the `names` name
        changes by `numbers` (n x nname); None of a chain, whose lumps tell as much.
        """
        return None

    def interval_with(self, deviations: Array) -> tuple[Array, Array]:
        """Least and largest values (nvalue) that 95 % are within by their standard `deviations` (nvalue)."""
        raise NotImplementedError

    def half_width_with(self, covariance: Array) -> float:
        """Half the widest of intervals that hold all that is wanted at once, as a share of it, with a `covariance` of
        the values (nvalue x nvalue).
        """
        raise NotImplementedError

    def shares(self, true: Array | None) -> tuple[Array, Array | None]:
        """Standard deviations (nvalue) and, where what is `true` (nvalue) is known, errors, as shares of each lump; of
        an arm of how wrong each base parameter may have been beforehand.
        """
        raise NotImplementedError

    def in_words(self, changes: Array) -> str:
        """What `changes` of what the `names` name (nname) change most, and by how much: `gravity_1 would be 3 %
        larger`.
        """
        raise NotImplementedError

    @property
    def number_covariance(self) -> Array:
        """Of what the `names` name (nname x nname)."""
        return np.asarray(self.to_numbers @ self.covariance @ self.to_numbers.T, dtype=np.float64)

    @cached_property
    def value_covariance(self) -> Array:
        """Of the values (nvalue x nvalue)."""
        return self.of_values(self.number_covariance)

    def of_values(self, covariance: Array) -> Array:
        """Covariance of the values (nvalue x nvalue), by a `covariance` of what the `names` name (nname x nname)."""
        return np.asarray(self.to_values @ covariance @ self.to_values.T, dtype=np.float64)

    @property
    def value_deviations(self) -> Array:
        """Standard deviation of each value (nvalue), in its unit."""
        return np.sqrt(np.diag(self.value_covariance))

    @property
    def half_width(self) -> float:
        """Half the widest of intervals that hold all that is wanted at once, as a share of it."""
        return self.half_width_with(self.value_covariance)

    @property
    def widening(self) -> float:
        """By how much what is not explained makes standard deviations larger than if all were."""
        if self.is_explained:
            return 1.0
        return max(self.misfit if self.led_misfit is None else self.led_misfit, 1.0)

    @property
    def point(self) -> Array:
        """All unknowns of the fit: of the robot, faults, and the start speeds of each push."""
        return np.concatenate([self.start, self.extras])

    @property
    def start(self) -> Array:
        """The unknowns of the robot and the faults, from which a fit to more trials begins."""
        return self.unknowns if self.faults is None else np.append(self.unknowns, self.faults.unknowns)
