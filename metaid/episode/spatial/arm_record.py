"""What an episode of an arm showed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from metaid.episode.measures import SPEED_RESOLUTION, fall_value
from metaid.episode.outcome import Outcome
from metaid.episode.readings import SensorReadings
from metaid.episode.spatial.arm_episode import ArmEpisode
from metaid.episode.windows import Windows
from metaid.models import Array

ALIKE = 1e-9  # relative: how far two loops may differ that take the same steps


@dataclass(frozen=True)
class ArmMeasure:
    """What is minimised: its `name` and its `unit`. It sees all base parameters."""

    name: str
    unit: str

    sees_coriolis: ClassVar[bool] = True
    is_noisy: ClassVar[bool] = False


KINETIC = ArmMeasure("kinetic", "Hz")  # Eq. 44


@dataclass(frozen=True, eq=False)
class ArmRecord:
    """What an episode of an arm showed.

    Attributes:
        timestep: between two torques, in s.
        steps: of each push (npush), up to the fall where it fell.
        fell: which pushes did (npush).
        speed_energy: Σ q̇ᵀ M̄ q̇ dt of each push (npush), M̄ being the nominal mass matrix, in J s.
        acceleration_energy: Σ (q̈ + k (q − q₀))ᵀ M̄ (q̈ + k (q − q₀)) dt of each push (npush), in J/s.
        windows: the motion as the sensors saw it; crossings are not counted.
        readings: what noisy sensors read; None where they are exact.
    """

    timestep: float
    steps: NDArray[np.int64]
    fell: NDArray[np.bool_]
    speed_energy: Array
    acceleration_energy: Array
    windows: Windows
    readings: SensorReadings | None = None

    def first(self, pushes: int) -> ArmRecord:
        """What the first `pushes` showed; windows and readings keep their shape."""
        return replace(
            self,
            steps=self.steps[:pushes],
            fell=self.fell[:pushes],
            speed_energy=self.speed_energy[:pushes],
            acceleration_energy=self.acceleration_energy[:pushes],
            windows=self.windows.first(pushes),
            readings=None if self.readings is None else self.readings.first(pushes),
        )

    @property
    def frequency(self) -> float:
        """Rice's frequency in the kinetic metric, in Hz; 0 only where every push went as the law was to make it go.

        Eq. 44.
        """
        energy = float(self.speed_energy.sum())
        squared = float(self.acceleration_energy.sum()) / energy if energy > 0.0 else np.inf
        return float(np.sqrt(squared) / (2.0 * np.pi))


def ceiling_hz(timestep: float) -> float:
    """Above every survivor's frequency: half the sampling rate, `timestep` in s."""
    return 0.5 / timestep


def resolution_hz(horizon: float) -> float:
    """Below this the frequency of an arm passes for none, in Hz: speeds change by less than SPEED_RESOLUTION in a
    `horizon` (s).
    """
    return SPEED_RESOLUTION / (2.0 * np.pi * horizon)


def failed_push(episode: ArmEpisode, timestep: float, reason: str) -> Outcome:
    """What the searcher is told of a candidate that could not be evaluated for a `reason`.

    Args:
        episode: that it was to have.
        timestep: between two torques, in s.
        reason: why not.
    """
    worst = fall_value(ceiling_hz(timestep), 0, episode.total_steps)
    return Outcome(worst, True, 0, (0,) * episode.njoint, reason)


def same_arm_record(one: ArmRecord, other: ArmRecord) -> bool:
    """Whether two loops showed the same, to rounding."""
    if (one.steps != other.steps).any() or (one.fell != other.fell).any():
        return False
    # What accelerates an arm that coasts is rounding, and no two loops round alike. Its size is that of the speeds.
    angles, speeds, turned, jumped = (
        (one.windows.motion[:, :, i], other.windows.motion[:, :, i], other.windows.motion[:, :, size])
        for i, size in enumerate((0, 1, 2, 2))
    )
    energies = (
        (one.speed_energy, other.speed_energy, other.speed_energy),
        (one.acceleration_energy, other.acceleration_energy, other.speed_energy),
    )
    pairs = [angles, speeds, turned, jumped, *energies]
    if one.readings is not None and other.readings is not None:
        pairs.append((one.readings.angles, other.readings.angles, other.readings.angles))
    return all(
        bool(np.allclose(mine, theirs, ALIKE, ALIKE * np.abs(size).max(initial=0.0))) for mine, theirs, size in pairs
    )
