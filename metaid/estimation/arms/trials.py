"""What one trial showed of an arm, and the law that it was sent."""

from __future__ import annotations

from dataclasses import dataclass

from metaid.compiled.arms import Frames, commanded_arm_torques
from metaid.episode import SensorReadings, Windows
from metaid.episode.arms import ArmEpisode
from metaid.estimation.noisy import ReadTrial, filtered_speeds
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
) -> ReadTrial:
    """The trial on noisy sensors in which a law led to these readings.

    Args:
        frames: of the arm.
        law: parameters of the candidate that was sent (njoint x 13).
        episode: what was done.
        timestep: between two torques, in s.
        read: what the sensors read.
        noise: standard deviation of a reading of each joint (njoint), in rad or m.
    """
    speeds = read.speeds
    if speeds is None:
        speeds = filtered_speeds(read.angles, episode.states[:, 1], slope_weights(timestep))
    torques = commanded_arm_torques(frames, law, episode, read.angles, speeds)
    poses, begun = episode.states.swapaxes(0, 1)
    return ReadTrial(timestep, read.angles, torques, read.steps, begun, None, noise, poses=poses)
