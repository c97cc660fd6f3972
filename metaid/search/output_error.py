"""The closed-loop output-error method: the next law is that of the chain which shows what all trials showed.

A simulated twin is fitted to the motion of every push of every trial so far (`metaid.estimation`), so a handful of
trials is enough where a minimiser, which keeps one number of each, needs hundreds. The first law over-compensates:
under it nothing falls, the mass matrix shows, and squares have their signs. A law near the truth shows no mass matrix,
for nothing accelerates. So laws over-compensate again where that tells more: on a noisy plant by what trials of either
kind have told, elsewhere where intervals have stopped shrinking and trials are to go on until they are narrow. An
estimate that does not explain what was seen is never sent, and another is made only once there is half as much again to
explain. On a noisy plant trials go on until the intervals stop shrinking, on any plant until a trial's motion is not
kept for the estimate any more.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from metaid.episode import Outcome
from metaid.errors import StudyError
from metaid.files import Settings
from metaid.models import Array
from metaid.search.coordinates import Coordinates

if TYPE_CHECKING:
    from metaid.estimation import Experiment, Found

FEW = 4  # trials; so many are matched after each
MANY = 8  # trials; where these were not explained from anywhere, a fit of more begins nowhere else
MORE = 1.5  # times the trials that no model explained; with fewer none is looked for again: each fit costs more


class OutputErrorOptions(Settings):
    """`probes`: how many of the first trials over-compensate (default: one where speeds are compared, two where only
    frequencies are)."""

    probes: Annotated[int, Field(ge=1, le=1000)] | None = None


class OutputError:
    """One trial a generation: probes that over-compensate, then the estimate from all trials before.

    Args:
        coordinates: with the start and the bounds of the factors.
        seed: of the probes.
        options: how many probes there are.
        experiment: how the plant is pushed and what of it is unknown.

    Raises:
        StudyError: the study keeps neither windows nor readings, so that there is nothing to match.
    """

    def __init__(
        self, coordinates: Coordinates, seed: int, options: OutputErrorOptions, experiment: Experiment | None
    ) -> None:
        if experiment is None:
            raise StudyError("sampler 'output-error' needs an estimate: see [estimate] and 'metaid study check'")
        self._coordinates = coordinates
        self._experiment = experiment
        self._random = np.random.default_rng(seed)
        self._probes = options.probes or experiment.probes
        self._next, self._is_probe = self._probe(None), True
        self._trials: list[Any] = []
        self._were_probes: list[bool] = []
        self._estimate: Found | None = None
        self._matched = 0  # trials that the last estimate is of
        self._coasts = self._settled = self._spent = False
        self._trial_count = 0
        self.until: float | None = None

    @property
    def spread(self) -> float | None:
        """The largest standard deviation of an unknown by the estimate."""
        return None if self._estimate is None else float(self._estimate.deviations.max())

    def ask(self) -> Array:
        return self._next[None]

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        (outcome,) = outcomes
        self._trial_count += 1
        trial = self._experiment.trial(self._next, outcome)
        if trial is not None:
            self._trials.append(trial)
            self._were_probes.append(self._is_probe)
        self._spent = trial is None and outcome.failure is None
        if self._trial_count >= self._probes and self._is_due:
            before, at_estimate = self._estimate, self._is_explained
            self._estimate = self._experiment.estimate(self._trials, before, thorough=len(self._trials) <= MANY)
            self._matched = len(self._trials)
            self._coasts = at_estimate and not outcome.fell and self._experiment.is_coasting(outcome.value)
            if at_estimate and before is not None and self._estimate is not None and self._is_explained:
                self._settled = self._settled or self._experiment.is_settled(before, self._estimate)
        if self._estimate is not None and self._is_explained:
            factors = self._experiment.factors(self._estimate)
            self._is_probe = self._experiment.is_to_probe(
                self._trials, self._were_probes, self._estimate, self._settled
            )
            if self._is_probe:
                factors = self._experiment.probe(factors, self._random)
            self._next = np.clip(factors, self._coordinates.low, self._coordinates.high)
        else:
            self._next, self._is_probe = self._probe(self._random), True

    @property
    def _is_explained(self) -> bool:
        return self._estimate is not None and self._estimate.is_explained

    @property
    def _is_due(self) -> bool:
        """Whether there is more to match than before, and after many trials that no model explains, much more."""
        count = len(self._trials)
        return count > self._matched and (self._is_explained or count <= FEW or count >= MORE * self._matched)

    def widen(self, coordinates: Coordinates) -> None:
        self._coordinates = coordinates

    @property
    def half_width(self) -> float:
        """Half the widest of intervals that hold all lumps at once with 95 %, as a share of its lump; inf where nothing
        is explained yet.  Eq. 32.
        """
        if self._estimate is None or not self._is_explained:
            return np.inf
        return self._estimate.half_width

    def finished(self) -> bool:
        """Whether the plant coasts under the law of the estimate, or one more trial tells no more; given `until`, in
        place of the last whether all lumps are known as well.
        """
        enough = self._settled if self.until is None else self.half_width <= self.until
        return self._coasts or enough or self._spent

    def _probe(self, random: np.random.Generator | None) -> Array:
        """A law that shows much."""
        factors = self._experiment.probe(self._coordinates.origin, random)
        return np.clip(factors, self._coordinates.low, self._coordinates.high)
