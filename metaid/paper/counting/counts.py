"""What is compared where counts are: the plant's, in whole half periods, and the twin's with what they are made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.estimation import (
    Counters,
    LogUnknowns,
    Motions,
    Replay,
    Residuals,
    WatchedTrial,
    WatchedTrials,
    count_crossings,
)
from metaid.models import Array

ROUNDING = 1.0 / np.sqrt(12.0)  # standard deviation of what an integer says of a number of half periods
OUTLYING = 3.0  # of these: what is farther off has less weight, for one lost pair of crossings moves all later counts


@dataclass(frozen=True, eq=False)
class Counted:
    """Counts of all pushes, joints and windows (ncount), of the plant and of a twin.

    Attributes:
        seen: half periods that the plant showed (ncount).
        shown: those of the twin (ncount).
        turns: half turns of the twin's phase (ncount), whose whole part is `shown`; with derivatives `slopes` (ncount x
            nunknown).
        gained: how many more half periods than the plant the twin has within each window alone (ncount).
        touches: extrema of the twin next to the upright (ncount x 2), see `Counters`, as shares of what the
            fastest joint of the push would swing by; with derivatives `touch_slopes` (ncount x 2 x nunknown).
    """

    seen: NDArray[np.int64]
    shown: NDArray[np.int64]
    turns: Array
    slopes: Array
    gained: NDArray[np.int64]
    touches: Array
    touch_slopes: Array

    @property
    def differing(self) -> int:
        """How many counts differ."""
        return int(np.count_nonzero(self.seen != self.shown))

    def deviations(self, by_side: bool) -> Array:
        """How far each phase is from the middle of the half turn that it should be in (ncount), in half turns; with
        `by_side` from the middle of the nearest half turn on the same side of the upright.
        """
        off = self.turns - self.seen - 0.5
        return (off + 1.0) % 2.0 - 1.0 if by_side else off


@dataclass(frozen=True)
class Counts(WatchedTrials):
    """The counts of all `trials` beside those of a twin. As something that is fitted, the residuals are phases in units
    of what rounding to a whole count leaves open, with less weight for outliers. `by_side`: see `Counted.deviations`.
    A joint at rest right after a push is left out for that push.
    """

    unknowns: LogUnknowns
    by_side: bool = False

    def __post_init__(self) -> None:
        if not any(trial.windows.seen.any() for trial in self.trials):
            raise ValueError("no push of any trial was seen to the end of its shortest window: nothing is counted")

    def counted(self, log_factors: Array, windows: int, slopes: bool = True) -> Counted | None:
        """The counts of the first `windows` windows, with or without `slopes`; None where the twin did not get through
        them.
        """
        parts = []
        for trial in self.trials:
            seen = trial.seen(windows)
            if not seen.any():
                continue
            shown, reached = count_crossings(trial, self.unknowns, log_factors, seen.shape[1], slopes)
            if (reached < seen.sum(axis=1)).any():
                return None
            parts.append(_beside(trial, shown, seen))
        return Counted(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    def residuals(self, log_factors: Array, windows: int) -> Residuals | None:
        """Those of the first `windows` windows, or None where the twin did not get through them."""
        counted = self.counted(log_factors, windows)
        if counted is None:
            return None
        values = counted.deviations(self.by_side) / ROUNDING
        squares = (values / OUTLYING) ** 2
        weights = 1.0 / np.sqrt(1.0 + squares)  # of Cauchy's distribution, Eq. 29
        cost = 0.5 * OUTLYING**2 * float(np.log1p(squares).sum())
        slopes = weights[:, None] * counted.slopes / ROUNDING
        return Residuals(weights * values, slopes, cost, len(values), np.empty((0, 1 + len(log_factors))))

    def by_joint(self, log_factors: Array) -> tuple[Array, ...]:
        """Root mean square over all windows of the difference of the counts of each trial (npush x njoint); NaN where a
        push was not seen.
        """
        tables = []
        for trial in self.trials:
            seen = trial.seen(len(trial.ends))[..., None]
            shown, _ = count_crossings(trial, self.unknowns, log_factors, len(trial.ends), False)
            squares = np.where(seen, shown.counts - trial.windows.half_periods, 0.0) ** 2
            with np.errstate(invalid="ignore"):  # of a push that was not seen
                tables.append(np.sqrt(squares.sum(axis=1) / seen.sum(axis=1)))
        return tuple(tables)

    def replay(self, number: int, log_factors: Array) -> Replay:
        """The trial of that `number`, and the twin at these `log_factors` (nunknown) in its place."""
        return Motions(self.trials, self.unknowns).replay(number, log_factors)


def _beside(trial: WatchedTrial, shown: Counters, seen: NDArray[np.bool_]) -> tuple[Array | NDArray[np.int64], ...]:
    """The fields of `Counted` for one trial, of the windows that were `seen` (npush x nwindow)."""
    npush, windows = seen.shape
    plants = trial.windows.half_periods[:, :windows]
    last = np.maximum(trial.windows.seen - 1, 0)
    half_periods = trial.windows.half_periods[np.arange(npush), last] + 0.5
    rate = (np.pi * half_periods / (trial.timestep * trial.ends[last])[:, None])[:, None]  # ω of Eq. 28, in rad/s
    angle, speed = rate * shown.states[:, :, 0], shown.states[:, :, 1]
    length = np.maximum(np.pi * (angle**2 + speed**2), np.finfo(float).tiny)
    turns = shown.counts + np.arctan2(angle, speed) / np.pi
    slopes = (rate * speed / length)[..., None] * shown.state_slopes[:, :, 0]
    slopes = slopes - (angle / length)[..., None] * shown.state_slopes[:, :, 1]
    gained = np.diff(shown.counts - plants, axis=1, prepend=0)
    unit = (rate / np.abs(trial.start_speeds).max(axis=1)[:, None, None])[:, :, None]
    touches = np.swapaxes(unit * shown.touches, 2, 3)
    touch_slopes = np.swapaxes(unit[..., None] * shown.touch_slopes, 2, 3)
    used = seen[..., None] & (trial.start_speeds != 0.0)[:, None]
    return plants[used], shown.counts[used], turns[used], slopes[used], gained[used], touches[used], touch_slopes[used]
