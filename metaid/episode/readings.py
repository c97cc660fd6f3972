"""What the sensors of a noisy plant read after each push: what a twin is fitted to where windows would keep the noise.

A law acts on noisy readings. With these the torque that it commanded is known to the last bit, and a simulated twin can
be driven by that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array

FINEST = 1e-9  # rad: a smaller change of an angle is rounding
WHOLE = 1e-3  # of an encoder's step, by which a change may differ from whole steps: rounding


@dataclass(frozen=True, eq=False)
class SensorReadings:
    """Sensor readings of an episode's pushes, the one right after the push first; zero where there are none.

    Attributes:
        counts: how many readings there are of each push (npush): at most one more than the steps that are kept, those
            before a fall, and none of a push that was not begun.
        angles: of the joints (npush x nreading x njoint), in rad.
        speeds: of the joints (npush x nreading x njoint), in rad/s; None where there is no speed sensor.
        times: since the push, in s (npush x nreading); None where the plant does not tell them.
    """

    counts: NDArray[np.int64]
    angles: Array
    speeds: Array | None = None
    times: Array | None = None

    @property
    def encoder_steps(self) -> Array:
        """The resolution of each joint's encoder (njoint), in rad, as far as the readings show one: the least change
        of an angle, or the least difference of two changes, where all changes are whole multiples of it and not all
        alike; else 0.
        """
        seen = np.arange(1, self.angles.shape[1]) < self.counts[:, None]  # npush x nreading - 1
        changes = np.abs(np.diff(self.angles, axis=1)[seen])  # of all pushes, (nchange x njoint)
        steps = np.zeros(self.angles.shape[2])
        for joint, turned in enumerate(changes.T):
            differences = np.concatenate([turned, np.diff(np.sort(turned))])
            least = differences[differences > FINEST].min(initial=np.inf)
            multiples = turned / least
            whole = (np.abs(multiples - np.round(multiples)) < WHOLE).all()
            steps[joint] = least if whole and len(np.unique(np.round(multiples))) > 1 else 0.0
        return steps

    @property
    def steps(self) -> NDArray[np.int64]:
        """How many steps of each push (npush) were seen."""
        return np.maximum(self.counts - 1, 0)

    def first(self, pushes: int) -> SensorReadings:
        """The same without what was read after the first `pushes`."""
        is_kept = np.arange(len(self.counts)) < pushes
        angles = self.angles * is_kept[:, None, None]
        speeds = None if self.speeds is None else self.speeds * is_kept[:, None, None]
        times = None if self.times is None else self.times * is_kept[:, None]
        return replace(self, counts=self.counts * is_kept, angles=angles, speeds=speeds, times=times)


def told_times(times: Sequence[Array | None], readings: SensorReadings) -> SensorReadings:
    """The `readings` with the `times`, in s, of each push that was begun (nreading), unless a push has none."""
    if any(each is None for each in times):
        return readings
    kept = np.zeros(readings.angles.shape[:2])
    for push, (each, count) in enumerate(zip(times, readings.counts, strict=False)):
        assert each is not None
        kept[push, :count] = each[:count]
    return replace(readings, times=kept)


def readings_before_fall(
    motions: Sequence[tuple[Array, Array]], steps: int, fell: NDArray[np.bool_], has_speed_sensor: bool
) -> SensorReadings:
    """The readings of an episode, without those that falls ended with.

    Args:
        motions: joint angles and speeds (nstep + 1 x njoint) as they were read after each push that was begun.
        steps: how many steps of each push are kept.
        fell: which pushes ended in a fall (npush), those that were never begun too.
        has_speed_sensor: whether the speeds were read, and not computed from angles.
    """
    npush, njoint = len(fell), motions[0][0].shape[1]
    counts = np.zeros(npush, dtype=np.int64)
    angles, speeds = np.zeros((2, npush, steps + 1, njoint))
    for push, (read_angles, read_speeds) in enumerate(motions):
        count = counts[push] = min(len(read_angles) - int(fell[push]), steps + 1)
        angles[push, :count], speeds[push, :count] = read_angles[:count], read_speeds[:count]
    return SensorReadings(counts, angles, speeds if has_speed_sensor else None)
