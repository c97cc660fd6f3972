"""What all trials of a study of an arm say together, with its base parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from metaid.estimation import Approximation, ArmEstimate, HeldOut
from metaid.models import COARSEST, DEVIATIONS, Array
from metaid.models.tree import possible_bodies
from metaid.study.estimates.study_estimate import StudyEstimate
from metaid.study.parameters import Known, Parameters


@dataclass(frozen=True)
class ArmFound(StudyEstimate):
    """That of an arm."""

    estimate: ArmEstimate

    @property
    def deviations(self) -> Array:
        """Standard deviation of each base parameter (nbase), in its unit."""
        if self.approximation is not None:
            return self.approximation.deviations
        own, changes = self.estimate.value_deviations, np.linalg.norm(self._changes(self.shifts), axis=0)
        return np.asarray(np.hypot(own, changes), dtype=np.float64)

    @property
    def covariance(self) -> Array:
        """Of the base parameters (nbase x nbase)."""
        wider = self.deviations / self.estimate.value_deviations
        return np.asarray(self.estimate.value_covariance * np.outer(wider, wider), dtype=np.float64)

    @property
    def half_width(self) -> float:
        """Half the widest interval that holds the torque of each joint, as a share of it."""
        return self.estimate.half_width_with(self.covariance)

    @property
    def usual(self) -> str:
        return "springs, play, torques that come late or are cut off, or wrong frames"

    def shift_in_words(self, shift: Array) -> str:
        base, changes = self.estimate.searched.prior.base, self._changes(shift)
        moved = int(np.argmax(np.abs(changes) / self._scales))
        way = "larger" if changes[moved] > 0.0 else "smaller"
        return f"{base.names[moved]} would be {abs(changes[moved]):.2g} {base.units[moved]} {way}"

    def beyond(self, reach: Array) -> list[str]:
        changes = np.linalg.norm(self.estimate.searched.root @ reach, axis=1)
        names = self.estimate.searched.prior.base.names
        return [name for name, far in zip(names, changes > COARSEST * self._scales, strict=True) if far]

    def _approximated(self, held_out: HeldOut) -> Approximation:
        estimate = self.estimate
        count = len(estimate.unknowns)
        return Approximation(
            replace(held_out, unknowns=estimate.searched.values(held_out.unknowns[:, :count])),
            estimate.widening,
            estimate.residuals,
            estimate.searched.joints,
            estimate.value_deviations,
            np.linalg.norm(self._changes(self.shifts), axis=0),
            COARSEST * self._scales,
            not self.impossible and possible_bodies(estimate.searched.prior, estimate.values) is not None,
        )

    @property
    def _scales(self) -> Array:
        """What changes of each base parameter (nbase) are large or small beside."""
        beforehand = np.sqrt(np.diag(self.estimate.searched.prior.covariance))
        return np.maximum(np.abs(self.estimate.values), beforehand)

    def _changes(self, shift: Array) -> Array:
        """Of the base parameters (... x nbase), with a `shift` of the unknowns (... x nbase)."""
        return np.asarray(shift @ self.estimate.searched.root.T, dtype=np.float64)

    @property
    def values(self) -> Array:
        return self.estimate.values

    @property
    def value_covariance(self) -> Array:
        return self.covariance

    share_of = "what was not known"

    def shares(self, early: ArmEstimate, true: Array | None) -> tuple[Array, Array | None]:
        beforehand = np.sqrt(np.diag(self.estimate.searched.prior.covariance))
        return early.left_unknown, None if true is None else np.abs(early.values - true) / beforehand

    @property
    def correlated(self) -> tuple[list[str], Array]:
        return list(self.estimate.searched.prior.base.names), self.covariance

    def known(self, wanted: Parameters) -> Known:
        values, deviations = self.values, self.deviations
        reach, determined = DEVIATIONS * deviations, deviations <= COARSEST * wanted.sizes(values)
        systematic = self.systematic(self.estimate.searched.root)
        return Known(values, deviations, values - reach, values + reach, determined, systematic)
