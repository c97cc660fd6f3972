"""What all trials of a study of a chain say together, with its lumps as a view of the estimate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from metaid.estimation import Approximation, Estimate, HeldOut, has_mass
from metaid.models import COARSEST, DEVIATIONS, Array, half_width
from metaid.study.estimates.study_estimate import StudyEstimate, interval_name
from metaid.study.parameters import Known, Parameters


@dataclass(frozen=True)
class ChainFound(StudyEstimate):
    """That of a chain."""

    estimate: Estimate

    @cached_property
    def lump_deviations(self) -> Array:
        """The standard deviation of each lump (nlump), as a share of it. It holds what a force would change that the
        trials hint at, and where the estimate does not explain them what the misfit and repetition say.
        """
        own = np.sqrt(np.diag(self.lump_covariance))
        if self.approximation is not None:
            return own
        changes = np.linalg.norm(self.shifts @ self.estimate.design.T, axis=0)
        return np.asarray(np.hypot(own, changes), dtype=np.float64)

    @property
    def covariance(self) -> Array:
        """Of the unknowns (nunknown x nunknown): where the estimate is approximate, as wide as its intervals are."""
        estimate = self.estimate
        if self.approximation is None:
            return estimate.covariance
        wider = self.approximation.deviations / estimate.deviations
        return np.asarray(estimate.covariance * np.outer(wider, wider), dtype=np.float64)

    @property
    def lump_covariance(self) -> Array:
        """The same of the log factors of the lumps (nlump x nlump)."""
        design = self.estimate.design
        return np.asarray(design @ self.covariance @ design.T, dtype=np.float64)

    @property
    def half_width(self) -> float:
        """Half the widest of intervals that hold all unknown lumps at once, as a share of its lump.  Eq. 32."""
        return half_width(self.lump_deviations) if len(self.shifts) else self.estimate.half_width

    def _approximated(self, held_out: HeldOut) -> Approximation:
        estimate = self.estimate
        count = len(estimate.names)
        return Approximation(
            replace(held_out, unknowns=held_out.unknowns[:, :count]),
            estimate.widening,
            estimate.residuals,
            tuple(f"joint {i + 1}" for i in range(estimate.lumps.nlink)),
            estimate.deviations,
            np.linalg.norm(self.shifts, axis=0),
            np.full(count, COARSEST),
            not self.impossible and has_mass(estimate.lumps),
        )

    def shift_in_words(self, shift: Array) -> str:
        moved = int(np.argmax(np.abs(shift)))
        by = 100.0 * float(np.expm1(shift[moved]))
        return f"{self.estimate.names[moved]} would be {abs(by):.2g} % {'larger' if by > 0.0 else 'smaller'}"

    def beyond(self, reach: Array) -> list[str]:
        far = np.linalg.norm(reach, axis=1)
        return [name for name, each in zip(self.estimate.names, far, strict=True) if each > COARSEST]

    @property
    def usual(self) -> str:
        return "friction, play, torques that come late or are cut off, or wrong lengths"

    @property
    def description(self) -> str:
        estimate = self.estimate
        if estimate.counts is not None:
            return _describe_counts(estimate.misfit, estimate.explained_below, estimate.counts)
        return super().description

    @property
    def interval_name(self) -> str:
        return interval_name(self.estimate.counts)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Of its lumps."""
        return tuple(dict.fromkeys(name.partition("_")[0] for name in self.estimate.lump_names))

    def lumps_of(self, estimate: Estimate) -> Array:
        """The lumps (nlump) of an `estimate`."""
        return estimate.lumps.vector_of(self.kinds)

    @property
    def counts(self) -> int | None:
        return self.estimate.counts

    @property
    def values(self) -> Array:
        return self.lumps_of(self.estimate)

    @property
    def value_covariance(self) -> Array | None:
        return None if self.counts is not None else self.lump_covariance * np.outer(self.values, self.values)

    def shares(self, early: Estimate, true: Array | None) -> tuple[Array, Array | None]:
        return early.lump_deviations, None if true is None else np.abs(self.lumps_of(early) / true - 1.0)

    @property
    def correlated(self) -> tuple[list[str], Array]:
        return list(self.estimate.names), self.estimate.covariance

    def known(self, wanted: Parameters) -> Known:
        values, deviations = self.values, self.lump_deviations
        if (extent := self.estimate.extent) is None:
            reach = np.exp(DEVIATIONS * deviations)
            share = self.systematic(self.estimate.design)
            systematic = None if share is None else values * share
            return Known(
                values, values * deviations, values / reach, values * reach, deviations <= COARSEST, systematic
            )
        low, high = np.exp(extent) * wanted.nominal
        return Known(values, np.full(len(values), np.nan), low, high, high - low <= 2.0 * COARSEST * values)


def _describe_counts(misfit: float, explained_below: float, counts: int) -> str:
    """What it means that so many of all `counts` differ, in a sentence."""
    if misfit < explained_below:
        return f"the model counts what was counted: all {counts:,} counts of half periods are the same"
    return f"no model was found that counts what was counted: in the best, {misfit:,.0f} of {counts:,} counts differ"
