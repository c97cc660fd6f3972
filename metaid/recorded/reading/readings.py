"""What a log says before it is cleaned, and what was repaired in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array


@dataclass(frozen=True)
class Repair:
    """What was mended or understood of a log.

    Attributes:
        kind: one word for it.
        count: of rows, readings, columns or gaps.
        text: one short line.
    """

    kind: str
    count: int
    text: str


@dataclass(frozen=True)
class Readings:
    """The numbers of a log, NaN where a cell has none.

    Attributes:
        name: of the log, for messages.
        names: of angle, speed and torque the columns, joint by joint.
        times: of the rows (nrow), in s.
        angles: of the joints (nrow x njoint), in rad, of slides in m.
        speeds: (nrow x njoint), in rad/s or m/s; None where the log has none.
        torques: (nrow x njoint), in N m or N; None where the log has none.
        repairs: what was mended so far.
        rests: the rows (nrow) in which no joint moves, once this is known.
    """

    name: str
    names: Mapping[str, Sequence[str]]
    times: Array
    angles: Array
    speeds: Array | None
    torques: Array | None
    repairs: tuple[Repair, ...] = ()
    rests: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.times)

    @property
    def period(self) -> float:
        """The usual time between two rows, in s."""
        steps = np.diff(self.times)
        return float(np.median(steps[steps > 0.0]))

    def rows(self, which: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Readings:
        """The same with some of the rows alone, or in another order."""
        return replace(self, times=self.times[which]).mapped(lambda read: read[which])

    def mapped(self, change: Callable[[Array], Array]) -> Readings:
        """The same with every kind of readings (nrow x njoint) changed in the same way."""
        return replace(
            self,
            angles=change(self.angles),
            speeds=None if self.speeds is None else change(self.speeds),
            torques=None if self.torques is None else change(self.torques),
        )

    def repaired(self, kind: str, count: int, text: str) -> Readings:
        """The same, with one more repair said."""
        return replace(self, repairs=(*self.repairs, Repair(kind, int(count), text)))


def counted(count: int, what: str) -> str:
    """`1 row`, `2 rows`."""
    return f"{count:,} {what}{'' if count == 1 else 's'}"


def noise_of(read: Array) -> Array:
    """The standard deviation of the noise of each joint (njoint), by what `read` (nrow x njoint) leaves of a parabola:
    third differences have 20 times the variance of the noise.
    """
    return np.asarray(np.sqrt((np.diff(read, n=3, axis=0) ** 2).mean(axis=0) / 20.0), dtype=np.float64)


def resolution_of(read: Array) -> float:
    """The step of a sensor, by its readings (nrow): the usual least difference of two neighbours among them that
    differ. Of one that is not rounded it is next to nothing.
    """
    steps = np.abs(np.diff(read))
    steps = steps[steps > 1e-12 * max(float(np.quantile(np.abs(read), 0.9)), 1e-300)]
    return float(np.quantile(steps, 0.01)) if len(steps) else 0.0
