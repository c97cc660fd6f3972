"""What a run until intervals are narrow takes, by the nominal model, before any trial."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from metaid.errors import StudyError
from metaid.models import COARSEST
from metaid.search import SAMPLERS, OutputError
from metaid.study.problem import MOST_TRIALS, Problem
from metaid.study.spec import StudySpec

MARGIN = 0.7  # of the wanted width, on the nominal model: that of the plant differs by some tenths
OWN_NOISE = 1  # added to the study's seed: a rehearsal has other noise than the study


@dataclass(frozen=True)
class Forecast:
    """With how many `trials`, `pushes` and `seconds` of motion all lumps at once, or the torques of all joints of an
    arm, are known to `until` of each, with 95 %, if the nominal model were the truth. `half_width` is to what they
    would then be known; where it is above `until`, the trials that an estimate is made of are not enough, and
    `is_reached` is false.
    """

    until: float
    trials: int
    pushes: int
    seconds: float
    half_width: float

    @property
    def is_reached(self) -> bool:
        return self.half_width <= self.until

    @property
    def row(self) -> dict[str, Any]:
        """All of it as JSON."""
        return {
            "half_width": self.until,
            "is_reached": self.is_reached,
            "trials": self.trials,
            "pushes": self.pushes,
            "minutes": self.seconds / 60.0,
            "reached_half_width": self.half_width if math.isfinite(self.half_width) else None,
        }


def forecast(problem: Problem, until: float) -> Forecast:
    """What a run until intervals are as narrow takes: the search itself, on the nominal model in the plant's place,
    with noise of its own, until intervals are MARGIN times as narrow: those of the plant differ. The start speeds are
    the study's.  Raises StudyError where there is no such run.
    """
    refuse_until(problem.spec, until)
    experiment, objective = problem.rehearsal(OWN_NOISE)
    searcher = problem.make_searcher(lambda: experiment)
    assert isinstance(searcher, OutputError), "it goes by the estimate"
    searcher.until = MARGIN * until
    trials = steps = 0
    most = min(MOST_TRIALS, problem.trials_with_readings or problem.trials_with_windows)
    while trials < most and not searcher.finished():
        outcome = objective.evaluate(searcher.ask()[0], trials)
        searcher.tell([outcome])
        trials, steps = trials + 1, steps + outcome.steps
    return Forecast(until, trials, trials * problem.episode.npush, steps * problem.timestep, searcher.half_width)


def refuse_until(spec: StudySpec, until: float) -> None:
    """Raises StudyError where a study cannot be run until its intervals are as narrow."""
    if not 0.0 < until <= COARSEST:
        raise StudyError(f"until is {until:.3%} (allowed: above 0 to {COARSEST:.0%}, half an interval ÷ its value)")
    if not SAMPLERS[spec.study.sampler].by_estimate:
        able = ", ".join(name for name, each in SAMPLERS.items() if each.by_estimate)
        raise StudyError(f"until: sampler '{spec.study.sampler}' does not work by intervals (allowed: {able})")
