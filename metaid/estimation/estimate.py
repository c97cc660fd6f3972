"""What all trials of a study say of a chain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

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
    """What all trials say of a chain, whose unknowns are log factors z: a lump is e^z times the nominal's.

    Attributes:
        lumps: the chain's lumps; those that were known are the nominal's.
        extent: least and largest log factor (2 x nunknown) of the models that show exactly the counts that were seen;
            None where no counts were compared, or no model shows them. Half of it is 1.96 times the deviation.
        counts: how many counts were compared, of which the misfit is the number that differs; None where none were.
        faults: that were searched beside the lumps; None where none were.
        torque_noise: standard deviation of the noise of each joint's torque (njoint), in N m, that was found; None
            where none was looked for.
    """

    lumps: Lumps
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
    def half_width(self) -> float:
        """Half the widest of intervals that hold all unknown lumps at once, as a share of its lump.  Eq. 64.

        All models that count the same are within an extent at once.
        """
        if self.extent is not None:
            return float(np.sinh(0.5 * (self.extent[1] - self.extent[0]).max()))
        return half_width(self.deviations)

    def deviations_of(self, names: Sequence[str]) -> Array:
        """The standard deviation of each of these lumps (nlump), as a share of it.

        With exact lengths a_ij = l_i μ_j is as well known as μ_j.
        """
        return self.by_name(self.deviations, names)

    def extent_of(self, names: Sequence[str]) -> tuple[Array, Array] | None:
        """The least and the largest log factor of each of these lumps (nlump), or None where no extent is known."""
        if self.extent is None:
            return None
        return self.by_name(self.extent[0], names), self.by_name(self.extent[1], names)

    def by_name(self, values: Array, names: Sequence[str]) -> Array:
        """The `values` (nunknown) of the lumps of these names (nlump)."""
        known = dict(zip(self.names, values.tolist(), strict=True))
        return np.array([known.get(name, known.get(f"gravity_{name.rpartition('_')[2]}", np.nan)) for name in names])

    def interval(self, deviations: float = DEVIATIONS) -> tuple[Array, Array]:
        """Least and largest factor (nunknown) within so many standard `deviations`: 95 % of them by default.

        Eq. 27.
        """
        reach = deviations * self.deviations
        return np.exp(self.log_factors - reach), np.exp(self.log_factors + reach)


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
    return Estimate(**own, lumps=comparison.unknowns.lumps(log_factors), faults=faults)
