"""The experiment of a planar chain whose half periods are counted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from metaid.estimation import Estimate, Experiment, WatchedTrial
from metaid.models import Array
from metaid.paper.counting.counts import Counts
from metaid.paper.counting.matching import match_counts

PROBES = 10  # trials that over-compensate: a count says little


@dataclass(frozen=True, eq=False)
class CountedExperiment(Experiment):
    """One without noise: the half periods of each window are to be exactly those of the twin."""

    counts: ClassVar[bool] = True

    @property
    def probes(self) -> int:
        return PROBES

    def _comparison(self, trials: Sequence[WatchedTrial]) -> Counts:
        return Counts([trial for trial in trials if trial.windows.seen.any()], self.unknowns)

    def _fit(self, compared: Any, begin: Array | None, restarts: int) -> Estimate:
        return match_counts(compared, begin, restarts)
