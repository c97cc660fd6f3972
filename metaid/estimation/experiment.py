"""A study's experiment as the estimate needs it: how the plant is pushed, what is unknown of it, what is compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from metaid.episode import Windows
from metaid.estimation.fit import Estimate, fit
from metaid.estimation.motions import Motions, Quantity
from metaid.estimation.trials import WatchedTrial
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array, Lumps

EXPLAINED = 3.0  # a misfit below this says that the model explains what was seen


@dataclass(frozen=True)
class Experiment:
    """What is the same in all trials of a study.

    Attributes:
        nominal: the lumps that candidates are factors of.
        unknowns: what an estimate is of; it may have lumps that no law has, those of inertia.
        gravity: in m/s².
        timestep: between two torques, in s.
        start_speeds: joint speeds (npush x njoint) right after each push, in rad/s.
        compared: what of the motion is compared with the twin.
        resolution: of the measure, in its unit: a value below it passes for coasting.
        stiffness: k of the law, in 1/s².
    """

    nominal: Lumps
    unknowns: Unknowns
    gravity: float
    timestep: float
    start_speeds: Array
    compared: Quantity
    resolution: float
    stiffness: float = 0.0

    def trial(self, factors: Array, windows: Windows) -> WatchedTrial:
        """A trial whose law had these `factors` (nlump) of the nominal lumps, and what was seen of it."""
        return WatchedTrial(self.nominal.scaled(factors), self.timestep, self.start_speeds, windows, self.stiffness)

    def estimate(self, trials: Sequence[WatchedTrial], start: Estimate | None = None) -> Estimate | None:
        """What all `trials` say; None where they showed nothing, or no chain shows what they did.

        A `start` that explained the trials before is where the fit begins.
        """
        seen = [trial for trial in trials if trial.windows.seen.any()]
        if not seen:
            return None
        begin = start.log_factors if start is not None and self.is_explained(start) else None
        try:
            return fit(Motions(seen, self.unknowns, self.gravity, self.compared), begin)
        except ValueError:
            return None

    def is_explained(self, estimate: Estimate) -> bool:
        """Whether an `estimate` explains what was seen."""
        return estimate.misfit < EXPLAINED

    def is_coasting(self, value: float) -> bool:
        """Whether a trial with this `value` of the measure coasts."""
        return value <= self.resolution

    def factors(self, estimate: Estimate) -> Array:
        """The factors of the nominal lumps (nlump) that the law of an `estimate` has."""
        searched = self.nominal.searched
        factors: Array = estimate.lumps.vector_of(searched) / self.nominal.vector_of(searched)
        return factors
