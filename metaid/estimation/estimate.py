"""What all trials of a study say of a chain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from metaid.estimation.faults import FoundFaults, SearchedFaults, found_faults
from metaid.estimation.fit import Fit, Growing, find
from metaid.estimation.trials import Replay
from metaid.estimation.unknowns import Unknowns
from metaid.models import DEVIATIONS, Array, Lumps, half_width


class Comparison(Growing, Protocol):
    """What is compared: `Motions` of a plant without noise, or `Readings` of noisy sensors."""

    @property
    def unknowns(self) -> Unknowns:
        """The lumps that are unknown."""

    @property
    def faults(self) -> SearchedFaults:
        """The faults that are unknown beside them."""

    def replay(self, number: int, point: Array) -> Replay:
        """The trial of that `number`, and the twin at a `point` in its place."""


@dataclass(frozen=True)
class Estimate(Fit):
    """What all trials say of a chain, whose unknowns are log factors z of its parameters; see `Unknowns`. Its lumps are
    a view of these.

    Attributes:
        lumps: the chain's lumps; those that were known are the nominal's.
        lump_names: of those that follow from the unknowns (nlump).
        design: how the logarithms of these follow from z (nlump x nunknown).
        extent: least and largest log factor (2 x nlump) of the models that show exactly the counts that were seen;
            None where no counts were compared, or no model shows them. Half of it is 1.96 times the deviation.
        counts: how many counts were compared, of which the misfit is the number that differs; None where none were.
        faults: that were searched beside the lumps; None where none were.
        torque_noise: standard deviation of the noise of each joint's torque (njoint), in N m, that was found; None
            where none was looked for.
    """

    lumps: Lumps
    lump_names: tuple[str, ...]
    design: Array
    extent: Array | None = None
    counts: int | None = None
    faults: FoundFaults | None = None
    torque_noise: Array | None = None

    @property
    def point(self) -> Array:
        """All unknowns of the fit: log factors, faults, and the start speeds of each push."""
        return np.concatenate([self.start, self.extras])

    @property
    def start(self) -> Array:
        """The log factors and the faults, from which a fit to more trials begins."""
        return self.unknowns if self.faults is None else np.append(self.unknowns, self.faults.unknowns)

    @property
    def log_factors(self) -> Array:
        """z (nunknown)."""
        return self.unknowns

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
        """Half the widest of intervals that hold all unknown lumps at once, as a share of its lump.  Eq. 64.

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


def fit(
    comparison: Comparison, start: Array | None = None, restarts: int = 3, seed: int = 0, gives_up: bool = False
) -> Estimate:
    """The chain that all trials of a `comparison` lead to.

    Args:
        comparison: what is compared with the twin.
        start: log factors, with faults behind them (nunknown), to try before the nominal model, such as those of the
            estimate before.
        restarts: how often the fit may begin at a random point of the prior, where the misfit says that it ended in a
            wrong minimum.
        seed: of these points; the same seed gives the same estimate.
        gives_up: whether the fit ends as soon as it explains nothing any more.

    Raises:
        ValueError: the twin cannot follow the trials from any start, or the fit gave up.
    """
    found = find(comparison, start, restarts, seed, gives_up)
    if found is None:
        raise ValueError("no chain near the nominal one moves through any window: the nominal lumps are no chain's")
    count = len(found.names)
    log_factors, faults = found.unknowns[:count], None
    if comparison.faults.names:
        faults = found_faults(comparison.faults, found.unknowns[count:], found.deviations[count:])
    own = vars(found) | {"unknowns": log_factors, "covariance": found.covariance[:count, :count]}
    return Estimate(**own, **lump_view(comparison.unknowns, log_factors), faults=faults)


def lump_view(unknowns: Unknowns, log_factors: Array) -> dict[str, Any]:
    """What an `Estimate` has of the lumps that follow from `log_factors` (nunknown)."""
    return {
        "lumps": unknowns.lumps(log_factors),
        "lump_names": tuple(unknowns.lump_names),
        "design": unknowns.design,
    }
