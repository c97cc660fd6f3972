"""What became of a candidate."""

from __future__ import annotations

from dataclasses import dataclass, field

from metaid.episode.episode import Episode
from metaid.episode.measures import Measure, fall_value
from metaid.episode.readings import SensorReadings
from metaid.episode.windows import Windows

FALL_VALUE = "fall_value"  # the attribute of an Optuna trial that fell or failed with the value of its `Outcome`


@dataclass(frozen=True)
class Outcome:
    """What became of a candidate: its `value` in the measure's unit (for a fall, one above every survivor's), steps
    run, periods per joint, and the motion in windows or the sensors' readings where the episode keeps them.

    One that could not be evaluated has the `failure` that says why, and for the searcher is a fall before the first
    step, so worse than any that was seen.
    """

    value: float
    fell: bool
    steps: int
    periods: tuple[int, ...]
    failure: str | None = None
    windows: Windows | None = field(default=None, compare=False, repr=False)
    readings: SensorReadings | None = field(default=None, compare=False, repr=False)


def failure(measure: Measure, episode: Episode, timestep: float, reason: str) -> Outcome:
    """The outcome of a candidate that could not be evaluated: a fall before the first step.

    Args:
        measure: whose value of such a fall it has.
        episode: that could not be run.
        timestep: between two torques, in s.
        reason: why, in one line.
    """
    value = fall_value(measure.ceiling(episode, timestep), 0, episode.total_steps)
    return Outcome(value, True, 0, (0,) * episode.njoint, reason)
