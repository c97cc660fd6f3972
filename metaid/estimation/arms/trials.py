"""What one trial showed of an arm, and the law that it was sent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.compiled.arms import Frames, commanded_arm_torques
from metaid.episode import SensorReadings, Windows
from metaid.episode.arms import ArmEpisode
from metaid.estimation.noisy import filtered_speeds
from metaid.models import Array
from metaid.plant import slope_weights


@dataclass(frozen=True, eq=False)
class WatchedArmTrial:
    """A trial on an arm whose sensors are exact.

    Attributes:
        law: parameters of the candidate that was sent (njoint x 13).
        timestep: between two torques, in s.
        starts: joint coordinates and speeds (npush x 2 x njoint) at the start of each push.
        stiffness: k of the law on each push (npush), in 1/s².
        windows: what was seen.
    """

    law: Array
    timestep: float
    starts: Array
    stiffness: Array
    windows: Windows


@dataclass(frozen=True, eq=False)
class ArmReadTrial:
    """What noisy sensors of an arm read in one trial, and what it was sent.

    Attributes:
        timestep: between two torques, in s.
        readings: joint coordinates (npush x nstep + 1 x njoint), in rad or m, that of the start first.
        torques: as they were commanded (npush x nstep x njoint), in N m or N.
        steps: how many steps (npush) of each push were seen before a fall.
        starts: joint coordinates and speeds (npush x 2 x njoint) to which the arm was brought.
        start_spread: standard deviation of what it was brought to, coordinates and speeds (2 x njoint); None where that
            is exact.
        noise: standard deviation of a reading of each joint (njoint), in rad or m.
    """

    timestep: float
    readings: Array
    torques: Array
    steps: NDArray[np.int64]
    starts: Array
    start_spread: Array | None
    noise: Array

    @property
    def extras(self) -> int:
        """How many coordinates and speeds of starts are unknown."""
        return 0 if self.start_spread is None else len(self.starts) * int(np.count_nonzero(self.start_spread))


def watched_arm_trial(law: Array, episode: ArmEpisode, timestep: float, windows: Windows) -> WatchedArmTrial:
    """The trial on exact sensors in which a law led to these windows.

    Args:
        law: parameters of the candidate that was sent (njoint x 13).
        episode: what was done.
        timestep: between two torques, in s.
        windows: what was seen.
    """
    return WatchedArmTrial(law, timestep, episode.states, episode.stiffness, windows)


def read_arm_trial(
    frames: Frames,
    law: Array,
    episode: ArmEpisode,
    timestep: float,
    read: SensorReadings,
    noise: Array,
    start_spread: Array | None = None,
) -> ArmReadTrial:
    """The trial on noisy sensors in which a law led to these readings.

    Args:
        frames: of the arm.
        law: parameters of the candidate that was sent (njoint x 13).
        episode: what was done.
        timestep: between two torques, in s.
        read: what the sensors read.
        noise: standard deviation of a reading of each joint (njoint), in rad or m.
        start_spread: see `ArmReadTrial`.
    """
    speeds = read.speeds
    if speeds is None:
        speeds = filtered_speeds(read.angles, episode.states[:, 1], slope_weights(timestep))
    torques = commanded_arm_torques(frames, law, episode, read.angles, speeds)
    return ArmReadTrial(timestep, read.angles, torques, read.steps, episode.states, start_spread, noise)
