"""What all trials of a study say of a robot: the `Estimate` of a chain, and what it shares with that of an arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from metaid.estimation.faults import FoundFaults, SearchedFaults, found_faults
from metaid.estimation.fit import Fit, Growing, find, refine
from metaid.models import DEVIATIONS, Array, Lumps, half_width


class Comparison(Growing, Protocol):
    """What is compared: motions of a plant without noise, or `Readings` of noisy sensors."""

    @property
    def faults(self) -> SearchedFaults:
        """The faults that are unknown beside them."""


@dataclass(frozen=True, kw_only=True)
class Found(Fit):
    """What all trials say of a robot.

    Attributes:
        faults: that were searched beside what is unknown of it; None where none were.
        torque_noise: standard deviation of the noise of each joint's torque (njoint), in N m, that was found; None
            where none was looked for.
        led_misfit: the misfit of the twin that the readings lead, where noise of the torques stands for what the model
            has not, and `misfit` is that of the twin without it; None elsewhere.
    """

    faults: FoundFaults | None = None
    torque_noise: Array | None = None
    led_misfit: float | None = None

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


@dataclass(frozen=True, kw_only=True)
class Estimate(Found):
    """What all trials say of a chain, whose unknowns are log factors z of its parameters; see `Unknowns`. Its lumps are
    a view of these.

    Attributes:
        lumps: the chain's lumps; those that were known are the nominal's.
        lump_names: of those that follow from the unknowns (nlump).
        design: how the logarithms of these follow from z (nlump x nunknown).
        extent: least and largest log factor (2 x nlump) of the models that show exactly the counts that were seen;
            None where no counts were compared, or no model shows them. Half of it is 1.96 times the deviation.
        counts: how many counts were compared, of which the misfit is the number that differs; None where none were.
    """

    lumps: Lumps
    lump_names: tuple[str, ...]
    design: Array
    extent: Array | None = None
    counts: int | None = None

    @property
    def log_factors(self) -> Array:
        """z (nunknown)."""
        return self.unknowns

    @property
    def parameters(self) -> Array:
        """What the unknowns are the log factors of (nunknown), in SI units."""
        return parameters_of(self.names, self.lumps)

    @property
    def lump_covariance(self) -> Array:
        """Of the log factors of the lumps (nlump x nlump)."""
        return np.asarray(self.design @ self.covariance @ self.design.T, dtype=np.float64)

    @property
    def lump_deviations(self) -> Array:
        """The standard deviation of each lump (nlump), as a share of it."""
        return np.sqrt(np.diag(self.lump_covariance))

    @property
    def half_width(self) -> float:
        """Half the widest of intervals that hold all unknown lumps at once, as a share of its lump.  Eq. 32.

        All models that count the same are within an extent at once.
        """
        if self.extent is not None:
            return float(np.sinh(0.5 * (self.extent[1] - self.extent[0]).max()))
        return half_width(self.lump_deviations)

    def interval(self, deviations: float = DEVIATIONS) -> tuple[Array, Array]:
        """Least and largest factor (nlump) of each lump within so many standard `deviations`: 95 % of them by default.

        Eq. 27.
        """
        reach, log_factors = deviations * self.lump_deviations, self.design @ self.log_factors
        return np.exp(log_factors - reach), np.exp(log_factors + reach)


def parameters_of(names: Sequence[str], lumps: Lumps) -> Array:
    """The parameters of a chain by their `names` (nparameter), in SI units, from its lumps."""
    kinds = dict.fromkeys(name.partition("_")[0] for name in names)
    parts = [lengths_of(lumps) if kind == "length" else lumps.of(kind) for kind in kinds]
    return np.concatenate([*parts, np.empty(0)])


def lengths_of(lumps: Lumps) -> Array:
    """The lengths (nlink − 1), in m, of the chain that has these `lumps`, a_ij = l_i μ_j: those of the neighbours j.

    Eq. 2.
    """
    return np.asarray(np.diag(lumps.coriolis, 1) / lumps.gravity[1:], dtype=np.float64)


def fit(
    comparison: Comparison,
    start: Array | None = None,
    restarts: int = 3,
    seed: int = 0,
    refines: bool = False,
    explains: bool = False,
) -> Any:
    """The robot that all trials of a `comparison` lead to: a `Found`.

    Args:
        comparison: what is compared with the twin.
        start: unknowns of the robot, with faults behind them (nunknown), to try before the nominal model, such as
            those of the estimate before; None for where fits to such a robot begin.
        restarts: how often the fit may begin at a random point of the prior, where the misfit says that it ended in a
            wrong minimum.
        seed: of these points; the same seed gives the same estimate.
        refines: whether all windows are compared from the `start` on, where that is in the valley of the truth.
        explains: whether a fit is wanted only where it explains what was seen: then what will not is given up early.

    Raises:
        ValueError: the twin cannot follow the trials from any start, or explains them from none though it is to.
    """
    found = refine(comparison, start) if refines and start is not None else None
    found = found or find(comparison, begun(comparison, start), restarts, seed, explains)
    if found is None:
        raise ValueError("no robot near the nominal one moves through any window: the nominal model is none's")
    count = len(found.names)
    faults = None
    if comparison.faults.names:
        faults = found_faults(comparison.faults, found.unknowns[count:], found.deviations[count:])
    own = {"unknowns": found.unknowns[:count], "covariance": found.covariance[:count, :count], "faults": faults}
    return comparison.unknowns.estimated(vars(found) | own)


def begun(comparison: Comparison, start: Array | None) -> Array | None:
    """Where a fit begins (nunknown): at the `start` if there is one, else where fits to such a robot do, without
    faults; None for the nominal model.
    """
    begin = comparison.unknowns.begin if start is None else None
    return start if begin is None else np.append(begin, np.zeros(len(comparison.faults.names)))
