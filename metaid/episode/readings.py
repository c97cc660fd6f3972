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


def readings_before_fall(
    motions: Sequence[tuple[Array, Array, Array | None]], steps: int, fell: NDArray[np.bool_], has_speed_sensor: bool
) -> SensorReadings:
    """The readings of an episode, without those that falls ended with.

    Args:
        motions: `States` as they were read after each push that was begun; times that one of them lacks are not kept.
        steps: how many steps of each push are kept.
        fell: which pushes ended in a fall (npush), those that were never begun too.
        has_speed_sensor: whether the speeds were read, and not computed from angles.
    """
    npush, njoint = len(fell), motions[0][0].shape[1]
    counts = np.zeros(npush, dtype=np.int64)
    (angles, speeds), times = np.zeros((2, npush, steps + 1, njoint)), np.zeros((npush, steps + 1))
    for push, (read_angles, read_speeds, told) in enumerate(motions):
        count = counts[push] = min(len(read_angles) - int(fell[push]), steps + 1)
        angles[push, :count], speeds[push, :count] = read_angles[:count], read_speeds[:count]
        if told is not None:
            times[push, :count] = told[:count]
    tells = all(told is not None for *_, told in motions)
    return SensorReadings(counts, angles, speeds if has_speed_sensor else None, times if tells else None)
