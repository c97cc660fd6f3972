"""The clock of a log: jitter of a host's stamps, and packets that were lost.

Readings are taken at a regular rate, and stamped when a host gets to it. Whether the stamps or a regular clock are
truer is asked of the readings: of how smooth the angles are, and of speeds, which tell how long each step took.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.reading.readings import LogRun, counted, noise_of, resolution_of
from metaid.recorded.reading.times import rising

REGULAR = 0.02  # of a period, by which steps of a regular clock may differ
FAST = 0.9  # of the rows of a joint are slower than those by which times are judged
AS_LITTLE = 1.1  # times the least that a clock leaves
TRUER = 0.8  # times what the stamps leave: a clock that leaves more is no truer
FOLLOWS = 0.01  # of the difference between stamps and clock, that the clock follows at each row
DRIFT = 2.0  # s, over which a clock's rate may change
AHEAD = 7, 60  # rows, the median of which tells a lost packet from a late one
TELLS = 16.0  # rows of stamps half of which jitter by less than a period
CLEAR = 5.0  # deviations of the noise of a step of the angles, from which on speeds tell how long it took
WINDOW = 25  # rows, whose mean step is the usual one
COHERENT = 0.7, 1.02  # times the mean step, where the period is looked for
CLEARLY = 0.3  # of the stamps, that must agree on a period
BATCH = 250  # rows in which a host's clock and a robot's stay together
LIKELY = 1.5  # times the deviation of steps, that stamps are off at most
WORTH_SAYING = 0.1  # of a period
NEVER = 1e-9  # s: between two stamps that are the same
LATE = 0.5  # of a period: a stamp that is later may be of a later packet


def on_true_clock(readings: LogRun) -> LogRun:
    """The same with the times that its readings speak for, and lost packets said."""
    steps = np.diff(readings.times)
    period = readings.period
    many = np.round(steps / period)
    if np.quantile(np.abs(steps - many * period), 0.99) <= REGULAR * period:
        return _lost(rising(readings), int(np.maximum(many - 1.0, 0.0).sum()))
    told = _told_steps(readings)
    nothing = np.full_like(told, np.nan)
    period, ticks, times = _best_clock(readings, [told, nothing] if np.isfinite(told).any() else [nothing])
    lost = int((np.diff(ticks) - 1).sum())
    jitter, seen = float(np.std(readings.times - times)), float(np.std(steps - period * np.maximum(many, 1.0)))
    if jitter > LIKELY * float(np.std(steps)) or not _left(readings, times) < TRUER * _left(readings, readings.times):
        text = (
            f"stamps jitter by {1e3 * seen:.2g} ms from row to row, and no regular clock fits the readings better: kept"
        )
        return rising(readings.repaired("jitter", 0, text) if seen > WORTH_SAYING * period else readings)
    text = f"stamps jitter by {1e3 * jitter:.2g} ms: the readings speak for a regular clock, {1.0 / period:.4g} Hz"
    return _lost(rising(replace(readings, times=times - times[0]).repaired("jitter", len(readings), text)), lost)


def _best_clock(readings: LogRun, every_told: Sequence[Array]) -> tuple[float, NDArray[np.intp], Array]:
    """The regular clock that leaves least of the readings: its period, in s, its ticks (nrow) and their times (nrow).
    Of several that leave as little it is the one nearest to the stamps. Speeds that are coarse tell steps wrong, so
    that clocks without what they have told are tried, too.
    """
    clocks = []
    for period in sorted({_usual_step(readings, told) for told in every_told}):
        for told in every_told:
            counts = np.nan_to_num(np.maximum(np.round(told / period), 1.0)).astype(np.intp)  # 0 where nothing tells
            ticks = _ticks(readings.times, period, counts)
            clocks.append((period, ticks, _settled(readings.times, ticks)))
    left = [_left(readings, times) for _, _, times in clocks]
    least = [clock for clock, own in zip(clocks, left, strict=True) if own <= AS_LITTLE * min(left)]
    return min(least, key=lambda clock: float(np.std(readings.times - clock[2])))


def _lost(readings: LogRun, lost: int) -> LogRun:
    if not lost:
        return readings
    text = f"{counted(lost, 'row')} lost between others: torques hold, and long gaps are not fitted"
    return readings.repaired("lost rows", lost, text)


def _usual_step(readings: LogRun, told: Array) -> float:
    """The time between two packets, in s: as speeds have `told` (nrow − 1), else the usual mean of some steps."""
    if np.isfinite(told).sum() > 10 * WINDOW:
        usual = np.nanmedian(told)
        return float(np.nanmedian(told / np.maximum(np.round(told / usual), 1.0)))
    if len(readings) <= 2 * WINDOW:
        return readings.period
    mean = float(np.median(readings.times[WINDOW:] - readings.times[:-WINDOW])) / WINDOW
    return _coherent_step(readings.times, mean)


def _coherent_step(stamps: Array, mean: float) -> float:
    """The period of which stamps (nrow), in s, are most nearly multiples, not far below their `mean` step: whatever was
    lost between them.
    """
    periods = mean * np.linspace(*COHERENT, 8 * BATCH)
    parts = np.array_split(stamps, max(1, len(stamps) // BATCH))[:: max(1, len(stamps) // (16 * BATCH))]
    together = np.zeros(len(periods))
    for part in parts:
        together += np.abs(np.exp(2j * np.pi * np.outer(1.0 / periods, part - part[0])).sum(axis=1))
    is_clear = together.max() > CLEARLY * sum(map(len, parts))
    return float(periods[together.argmax()]) if is_clear else mean


def _told_steps(readings: LogRun) -> Array:
    """How long each step took by the speeds (nrow − 1), in s, NaN where the robot is too slow to tell, or a log has no
    speeds.
    """
    if readings.speeds is None:
        return np.full(len(readings) - 1, np.nan)
    moved = np.diff(readings.angles, axis=0)
    mean = 0.5 * (readings.speeds[1:] + readings.speeds[:-1])
    coarse = 0.3 * resolution_of(readings.speeds) * readings.period
    noise = np.hypot(np.sqrt(2.0) * noise_of(readings.angles), coarse) + 1e-12
    weights = np.where(moved.any(axis=0), 1.0 / noise**2, 0.0)
    across, whole = (weights * mean * moved).sum(axis=1), (weights * mean**2).sum(axis=1)
    clear = whole * readings.period**2 > CLEAR**2
    return np.where(clear, across / np.where(clear, whole, 1.0), np.nan)


def _ticks(stamps: Array, period: float, counts: NDArray[np.intp]) -> NDArray[np.intp]:
    """Which tick of a regular clock each packet is of (nrow), where the clock follows the stamps slowly. A packet is
    lost where speeds say so; where they do not tell, where the stamps after it are late, too.

    Args:
        stamps: of a host (nrow), in s.
        period: between two packets, in s.
        counts: how many packets each step is (nrow − 1); 0 where nothing tells.
    """
    given, steps = stamps.tolist(), counts.tolist()
    now, ticks = given[0], [0]
    jitter = float(np.subtract(*np.quantile(np.diff(stamps), (0.75, 0.25)))) / period
    ahead = int(np.clip(TELLS * jitter**2, *AHEAD))
    less = period * np.append(0, np.cumsum(np.maximum(counts, 1)))
    for row in range(1, len(given)):
        step = steps[row - 1]
        if not step:
            late = given[row] - now - period
            if late > LATE * period:
                coming = stamps[row : row + ahead] - less[row : row + ahead] + less[row]
                late = min(late, float(np.median(coming)) - now - period)
            step = 1 + max(0, round(late / period))
        now += step * period
        now += FOLLOWS * (given[row] - now)
        ticks.append(ticks[-1] + step)
    return np.array(ticks)


def _settled(stamps: Array, ticks: NDArray[np.intp]) -> Array:
    """The times of ticks (nrow) of a regular clock, in s: those of the stamps (nrow) but for a drift that lasts."""
    even = polynomial.polyval(ticks, polynomial.polyfit(ticks, stamps, 1))
    blocks = np.array_split(np.arange(len(stamps)), max(1, round((stamps[-1] - stamps[0]) / DRIFT)))
    off = [float(np.median(stamps[block] - even[block])) for block in blocks]
    return np.asarray(even + np.interp(ticks, [float(np.mean(ticks[block])) for block in blocks], off))


def _left(readings: LogRun, times: Array) -> float:
    """What these times (nrow) leave unexplained of the readings, as a share of a usual step: of angles what a cubic
    through two neighbours on either side does not explain, or of how far joints went in a step what their speeds do
    not say, whichever is less. Where joints are fastest, times matter most.
    """
    judges = [(_uneven(readings.angles, times), np.abs(np.diff(readings.angles, axis=0))[1:-2])]
    if readings.speeds is not None:
        mean = 0.5 * (readings.speeds[1:] + readings.speeds[:-1])
        said = np.abs(mean) * readings.period
        judges.append((np.diff(readings.angles, axis=0) - mean * np.diff(times)[:, None], said))
    each = []
    for left, moves in judges:
        fast = moves >= np.quantile(moves, FAST, axis=0)
        scale = np.maximum(np.sqrt((moves**2).mean(axis=0)), 1e-300)
        each += [np.median(np.abs(left[fast[:, joint], joint])) / scale[joint] for joint in range(left.shape[1])]
    return float(np.min(each))


def _uneven(angles: Array, times: Array) -> Array:
    """What a cubic through two neighbours on either side, at uneven times (nrow), leaves of angles (nrow − 4 x
    njoint).
    """
    middle, count = times[2:-2], len(times) - 4
    near = [(times[i : count + i], angles[i : count + i]) for i in (0, 1, 3, 4)]
    left = angles[2:-2].copy()
    for own, read in near:
        weight = np.ones_like(middle)
        for other, _ in near:
            if other is not own:
                weight *= (middle - other) / np.where(own == other, NEVER, own - other)
        left -= weight[:, None] * read
    return left
