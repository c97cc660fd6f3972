"""The episode of an arm: pushes from poses all over the joint ranges, and what they show.

`ArmEpisode` says what is done, `run_arm_stepwise` does it in plain Python, and `ArmRecord` is what was seen.
"""

from metaid.episode.spatial.arm_episode import RUNAWAY, ArmEpisode
from metaid.episode.spatial.arm_record import (
    KINETIC,
    ArmMeasure,
    ArmRecord,
    ceiling_hz,
    failed_push,
    resolution_hz,
    same_arm_record,
)
from metaid.episode.spatial.smoothed import smoothed_arm_frequency
from metaid.episode.spatial.stepwise import StepwiseArmLoop, run_arm_stepwise

__all__ = [
    "KINETIC",
    "RUNAWAY",
    "ArmEpisode",
    "ArmMeasure",
    "ArmRecord",
    "StepwiseArmLoop",
    "ceiling_hz",
    "failed_push",
    "resolution_hz",
    "run_arm_stepwise",
    "same_arm_record",
    "smoothed_arm_frequency",
]
