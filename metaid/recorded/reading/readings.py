"""What a log holds, and what was repaired in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array

TURN = 2.0 * np.pi  # rad
NO_READING = 1e15  # in any unit: what a recorder wrote that had none yet


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
class LogRun:
    """What a log holds, NaN where a cell has no number until it is cleaned.

    Attributes:
        name: of the file.
        times: when each row was read (nrow), in s.
        angles: joint coordinates (nrow x njoint), in rad, of slides in m.
        speeds: of the joints (nrow x njoint), in rad/s or m/s; None where the log has none.
        torques: of the joints (nrow x njoint), in N m or N, 0 where the log has none; each holds until the next row.
        repairs: what was repaired and understood of it.
        rests: the rows (nrow) in which no joint leaves what rounding and noise make; None: in none.
        names: of angle, speed and torque the columns in the log, in its order of the joints.
    """

    name: str
    times: Array
    angles: Array
    speeds: Array | None
    torques: Array
    repairs: tuple[Repair, ...] = ()
    rests: NDArray[np.bool_] | None = None
    names: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.times)

    @property
    def njoint(self) -> int:
        return int(self.angles.shape[1])

    @property
    def period(self) -> float:
        """The usual time between two rows, in s."""
        steps = np.diff(self.times)
        return float(np.median(steps[steps > 0.0]))

    @property
    def kinds(self) -> dict[str, Array]:
        """All that was read of the joints (nrow x njoint each): angles, speeds where the log has them, torques."""
        every = {"angle": self.angles, "speed": self.speeds, "torque": self.torques}
        return {kind: read for kind, read in every.items() if read is not None}

    @property
    def lacks(self) -> NDArray[np.bool_]:
        """Rows (nrow) in which some joint has no number."""
        return np.asarray(np.isnan(np.hstack([*self.kinds.values()])).any(axis=1))

    def with_kinds(self, kinds: Mapping[str, Array]) -> LogRun:
        """The same with other readings of some kinds (nrow x njoint each)."""
        return replace(self, **{f"{kind}s": read for kind, read in kinds.items()})  # type: ignore[arg-type]

    def rests_at(self, times: Array) -> NDArray[np.bool_]:
        """At which of some times (nrow), in s, the robot rests."""
        if self.rests is None:
            return np.zeros(len(times), dtype=np.bool_)
        nearest = np.searchsorted(0.5 * (self.times[1:] + self.times[:-1]), times)
        return np.asarray(self.rests[nearest], dtype=np.bool_)

    def rows(self, which: NDArray[np.bool_] | NDArray[np.intp] | slice) -> LogRun:
        """The same with some of the rows alone, or in another order."""
        rests = None if self.rests is None else self.rests[which]
        return replace(self, times=self.times[which], rests=rests).mapped(lambda read: read[which])

    def mapped(self, change: Callable[[Array], Array]) -> LogRun:
        """The same with every kind of readings (nrow x njoint) changed in the same way."""
        return self.with_kinds({kind: change(read) for kind, read in self.kinds.items()})

    def with_torques(self, torques: Array) -> LogRun:
        """The same motion under these `torques` (nrow x njoint)."""
        return replace(self, torques=torques)

    def repaired(self, kind: str, count: int, text: str) -> LogRun:
        """The same, with one more repair said."""
        return replace(self, repairs=(*self.repairs, Repair(kind, int(count), text)))


def counted(count: int, what: str) -> str:
    """`1 row`, `2 rows`."""
    return f"{count:,} {what}{'' if count == 1 else 's'}"


def straight(times: Array, own: Array, read: Array) -> Array:
    """What was `read` (nrow x ncolumn) at its `own` times (nrow), straight between two of these at others (...): (... x
    ncolumn).
    """
    return np.stack([np.interp(times, own, column) for column in read.T], axis=-1)


def noise_of(read: Array) -> Array:
    """The standard deviation of the noise of each joint (njoint), by what `read` (nrow x njoint) leaves of a parabola:
    third differences have 20 times the variance of the noise. That of rounding at least, which a sensor hides that
    hardly moves.
    """
    noise = np.sqrt((np.diff(read, n=3, axis=0) ** 2).mean(axis=0) / 20.0)
    return np.asarray(np.maximum(noise, resolution_of(read) / np.sqrt(12.0)), dtype=np.float64)


def resolution_of(read: Array) -> Array:
    """The step of the sensor of each joint (njoint), by what was `read` (nrow x njoint): the usual least difference of
    two neighbours that differ. Of one that is not rounded it is next to nothing.
    """
    return np.array([_least_step(column) for column in read.T])


def _least_step(read: Array) -> float:
    steps = np.abs(np.diff(read))
    steps = steps[steps > 1e-12 * max(float(np.quantile(np.abs(read), 0.9)), 1e-300)]
    return float(np.quantile(steps, 0.01)) if len(steps) else 0.0
