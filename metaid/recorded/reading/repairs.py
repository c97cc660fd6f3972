"""What sensors do to readings, repaired where the readings themselves say how: wild ones, angles that wrap, rows that
are there twice; and rest, which rounding and noise hide.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from metaid.errors import RecordError
from metaid.models import Array
from metaid.recorded.reading.readings import TURN, LogRun, counted, resolution_of

WILD = 12.0  # standard deviations of what neighbours leave of a reading
SHAPE = np.array([1.0 / 6.0, -2.0 / 3.0, 1.0, -2.0 / 3.0, 1.0 / 6.0])  # what one wild reading leaves of five
ALIKE = 0.2  # how far these may be from that shape
ALONE = 3.0  # times all that is left nearby
LASTS = 0.25  # of a wild reading: readings that differ by more before and after it are of a robot that stopped or hit
BEYOND = 3.0  # times the usual large step nearby
MOSTLY = 0.7  # of the readings nearby, others of which may be wild, too
NEARBY = 25  # rows on either side
SLIGHT = 1e-3  # of what a column spans: a wild reading that is less does no harm
HEAD, FARTHER, FAR = 25, 5.0, 10.0  # rows; times what a joint spans, and rad or m: farther off is no reading
SELDOM = 0.02  # of the readings: more wild ones are a broken sensor
NEAR_A_TURN = 0.6  # rad
FASTEST = 300.0  # rad/s: an angle that jumps faster is not an angle
JUMP = 0.3  # rad
MORE_ROWS = 1.5  # times the usual ones: a packet is not in more
FALLS_IN, FALLS = 0.05, 0.05  # s; of the most that a joint goes in it: where it falls so far its speed is below 0
TOGETHER = 0.9  # of the rows that repeat an angle: where so many repeat all readings, packets are whole
STEPS = 3.0  # of an encoder, that a joint moves between two rows where a repeated row can be told from rest
REST = 0.25  # s on either side in which no joint leaves what rounding and noise make
RESOLVED, ABOVE_NOISE = 2.1, 8.0  # steps of the encoder, deviations of its noise
CREEPS = 0.01  # of all that a joint moves: one that goes farther does not rest
MOST_RESTS = 0.95  # of a log


def tamed(readings: LogRun) -> LogRun:
    """The same with each lone wild reading replaced by what its four neighbours say; where torques or speeds have many,
    a controller sends them.  Raises RecordError where angles have too many.
    """
    for kind, read in readings.kinds.items():
        changed, found, kept = read.copy(), {}, {}
        for joint, name in enumerate(readings.names[kind]):
            rows = _wild(read[:, joint])
            if not len(rows):
                continue
            if len(rows) > max(3.0, SELDOM * len(readings)):
                if kind != "angle":
                    kept[name] = rows
                    continue
                raise RecordError(
                    f"{readings.name}: {name} has {len(rows):,} wild readings, the first in row {rows[0] + 1} "
                    f"(allowed: one in {1.0 / SELDOM:.0f})"
                )
            changed[rows, joint] = _between(read[:, joint])[rows - 2]
            found[name] = rows
        if found:
            count = sum(map(len, found.values()))
            where = ", ".join(found)
            first = min(int(rows[0]) for rows in found.values()) + 1
            text = (
                f"{counted(count, 'wild reading')} of {where} replaced by what its neighbours say, first in row {first}"
            )
            readings = readings.with_kinds({kind: changed}).repaired("wild", count, text)
        if kept:
            text = f"{', '.join(kept)} often far from readings before and after, as a controller's steps make it: kept"
            readings = readings.repaired("steps", sum(map(len, kept.values())), text)
    return readings


def without_head(readings: LogRun) -> LogRun:
    """The same without its first rows, up to the last that has no number or an angle where no joint of the log goes:
    recorders write what is in their memory while they have no reading. One such row alone is a wild reading.
    """
    angles, head = readings.angles, max(HEAD, round(SELDOM * len(readings)))
    if not np.isfinite(angles).all(axis=1).any():
        return readings
    low, middle, high = np.nanquantile(angles, (0.01, 0.5, 0.99), axis=0)
    far = np.abs(angles - middle) > FARTHER * (high - low) + FAR
    unread = far.any(axis=1) | readings.lacks
    if unread[:head].sum() < 2 or not far[:head].any() or far[head:].any():
        return readings
    count, row = int(np.flatnonzero(unread[:head])[-1]) + 1, int(far.any(axis=1).argmax())
    joint = int(far[row].argmax())
    text = (
        f"the first {count} rows left out: {readings.names['angle'][joint]} is {angles[row, joint]:.4g} in row "
        f"{row + 1}, where no joint of the log goes"
    )
    return readings.rows(slice(count, None)).repaired("head", count, text)


def _between(read: Array) -> Array:
    """Where a cubic through two neighbours on either side has readings (nrow − 4)."""
    return (4.0 * (read[1:-3] + read[3:-1]) - read[:-4] - read[4:]) / 6.0


def _wild(read: Array) -> NDArray[np.intp]:
    """Rows of lone wild readings of one column: what its neighbours leave of it stands out, and has the shape that one
    wrong reading makes, so that it is neither a step nor noise.
    """
    left = read[2:-2] - _between(read)
    size = np.abs(left)
    span = float(np.subtract(*np.quantile(read, (0.99, 0.01))))
    floor = max(SLIGHT * span, 5.0 * resolution_of(read[:, None])[0], WILD * 1.48 * float(np.median(size)) / 3.0)
    rows = []
    for row in np.flatnonzero(size[2:-2] > floor) + 2:
        five = left[row - 2 : row + 3] / left[row]
        if np.abs(five - SHAPE).max() > ALIKE or _lasting(read[row : row + 5]) > LASTS * size[row]:
            continue
        around = np.concatenate([size[max(row - NEARBY, 0) : row - 2], size[row + 3 : row + NEARBY]])
        usual = 1.48 * float(np.median(around))
        steps = np.abs(np.diff(read[max(row + 2 - NEARBY, 0) : row + NEARBY]))
        moved = BEYOND * float(np.quantile(steps, MOSTLY))
        if size[row] > max(WILD * usual, ALONE * float(np.quantile(around, MOSTLY)), moved):
            rows.append(row + 2)
    return np.array(rows, dtype=np.intp)


def _lasting(five: Array) -> float:
    """By how much a column goes elsewhere over the middle one of five readings than it does on either side."""
    before, last, _, following, after = five.tolist()
    return float(abs((following - last) - (last - before) - (after - following)))


def unwrapped(readings: LogRun, slides: NDArray[np.bool_]) -> LogRun:
    """The same with angles that go on where they were cut at a full turn.  Raises RecordError where an angle jumps
    otherwise, faster than any joint turns.
    """
    steps = np.diff(readings.angles, axis=0)
    turns = np.where(slides, 0.0, np.round(steps / TURN))
    turns[np.abs(steps - TURN * turns) > NEAR_A_TURN] = 0.0
    count = int((turns != 0.0).sum())
    if count:
        angles = readings.angles.copy()
        angles[1:] -= TURN * np.cumsum(turns, axis=0)
        where = ", ".join(readings.names["angle"][joint] for joint in np.flatnonzero(turns.any(axis=0)).tolist())
        text = f"{where} cut at a full turn {counted(count, 'time')}: joined"
        readings = replace(readings, angles=angles).repaired("turns", count, text)
        steps = np.diff(angles, axis=0)
    usual = np.maximum(np.diff(readings.times), readings.period)[:, None]
    bad = np.argwhere((np.abs(steps) > FASTEST * usual) & (np.abs(steps) > JUMP) & ~slides)
    if len(bad) and np.abs(readings.angles).max() < 25.0:  # else degrees are what is wrong
        row, joint = (int(each) for each in bad[0])
        raise RecordError(
            f"{readings.name}: row {row + 2}: {readings.names['angle'][joint]} jumps by {steps[row, joint]:.3g} rad in "
            f"{usual[row, 0]:.3g} s (allowed: at most {FASTEST:g} rad/s)"
        )
    return readings


def without_repeats(readings: LogRun) -> LogRun:
    """The same without rows that repeat all readings of the row above though the robot moves: packets that were sent,
    or written, twice. Where angles are usually read but once in several rows, a row is left of each reading, at rest as
    well, with speeds and torques that are averages of theirs. A new packet is seen by any of its readings, where all
    repeat together.
    """
    others = [read for kind, read in readings.kinds.items() if kind != "angle"]
    same, moves = _repeats(readings.angles), _moves(readings.angles)
    alike = np.all([_repeats(read) for read in others], axis=0)
    repeated = same & moves
    usual = _usual_repeats(same, moves)
    if usual > 1 and (repeated & alike).sum() > TOGETHER * repeated.sum():
        same = _whole_packets(same & alike, usual)
        usual = _usual_repeats(same, moves)
    if usual > 1:
        news = np.flatnonzero(~same)
        lasts = np.diff(news, append=len(same))
        since, last = np.arange(len(same)) - np.repeat(news, lasts), np.repeat(lasts, lasts)
        twice = same & (moves | (since % usual > 0) | (last - since < 0.5 * usual))
    else:
        twice = repeated & alike
    count, kept = int(twice.sum()), np.flatnonzero(~twice)
    if not count:
        return readings
    sizes = np.diff(kept, append=len(same))
    first = np.repeat(kept, sizes)

    def averaged(read: Array) -> Array:
        return np.asarray(read[kept] + np.add.reduceat(read - read[first], kept) / sizes[:, None], dtype=np.float64)

    differ = any((read != read[first]).any() for read in others)
    what = ("the angles", ", other readings averaged") if differ else ("all readings", "")
    text = f"{counted(count, 'row')} with {what[0]} of the row above, though the robot moves: left out{what[1]}"
    once = replace(readings.mapped(averaged), times=readings.times[kept])
    return once.repaired("repeated rows", count, text)


def _usual_repeats(same: NDArray[np.bool_], moves: NDArray[np.bool_]) -> int:
    """In how many rows a packet usually is, of those that begin where the robot `moves` (nrow), where rows are the
    `same` as the one above (nrow): a mean over packets that nothing hides, where most are in several.
    """
    news = np.flatnonzero(~same)
    lasts = np.diff(news, append=len(same))[np.maximum.reduceat(moves, news)]
    middle = float(np.median(lasts)) if len(lasts) else 1.0
    return round(float(lasts[lasts <= 2.0 * middle].mean())) if middle >= 2.0 else 1


def _whole_packets(same: NDArray[np.bool_], usual: int) -> NDArray[np.bool_]:
    """The same rows (nrow) but for those in which the rest is written of a packet that is usually in so many, where its
    first rows have only some of its readings.
    """
    news = np.append(np.flatnonzero(~same), len(same))
    whole, begins = same.copy(), 0
    for now, following, after in zip(news[:-2], news[1:-1], news[2:], strict=True):
        is_torn = now >= begins and following - now < 0.5 * usual and after - now <= MORE_ROWS * usual
        if is_torn:
            whole[following], begins = True, after
    return whole


def _repeats(read: Array) -> NDArray[np.bool_]:
    """Rows (nrow) whose readings (nrow x njoint) are all those of the row above."""
    return np.concatenate([[False], (read[1:] == read[:-1]).all(axis=1)])


def _moves(angles: Array) -> NDArray[np.bool_]:
    """Rows (nrow) around which a joint moves by some steps of its encoder (nrow x njoint) from one to the next."""
    rows, reach = np.arange(len(angles)), 10
    ahead, behind = np.minimum(rows + reach, rows[-1]), np.maximum(rows - reach, 0)
    steps = np.abs(angles[ahead] - angles[behind]) / (2.0 * reach)
    return np.asarray((steps > STEPS * np.maximum(resolution_of(angles), 1e-12)).any(axis=1), dtype=np.bool_)


def with_signs(readings: LogRun) -> LogRun:
    """The same with speeds that go as the angles do, where a log has but their size: none is below 0, though angles
    fall.
    """
    if readings.speeds is None:
        return readings
    stride = max(1, round(FALLS_IN / readings.period))
    moved = readings.angles[stride:] - readings.angles[:-stride]
    falls = moved.min(axis=0, initial=0.0) < -FALLS * np.abs(moved).max(axis=0, initial=0.0)
    unsigned = falls & (readings.speeds >= 0.0).all(axis=0) & readings.speeds.any(axis=0)
    if not unsigned.any():
        return readings
    signs = np.where(unsigned, np.sign(np.gradient(readings.angles, axis=0)), 1.0)
    where = ", ".join(readings.names["speed"][joint] for joint in np.flatnonzero(unsigned).tolist())
    text = f"{where} {'has' if unsigned.sum() == 1 else 'have'} no sign: taken from how angles change"
    return replace(readings, speeds=readings.speeds * signs).repaired("signs", int(unsigned.sum()), text)


def rested(readings: LogRun) -> LogRun:
    """The same with the rows known in which no joint leaves what rounding and noise make for a while: no model is
    fitted to these.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d  # slow to load

    size = 2 * max(1, round(REST / readings.period)) + 1
    if size >= len(readings):
        return readings
    noise = 1.48 * np.median(np.abs(np.diff(readings.angles, n=3, axis=0)), axis=0) / np.sqrt(20.0)
    within = np.maximum(RESOLVED * resolution_of(readings.angles), ABOVE_NOISE * noise)
    within = np.minimum(within, CREEPS * np.ptp(readings.angles, axis=0))
    spread = maximum_filter1d(readings.angles, size, axis=0) - minimum_filter1d(readings.angles, size, axis=0)
    rests = (spread <= within).all(axis=1)
    if not rests.any() or rests.mean() > MOST_RESTS or not spread[rests].any():
        return readings
    count = int(rests.sum())
    text = f"{counted(count, 'row')} in which no joint leaves the resolution and noise of its encoder: not fitted"
    return replace(readings, rests=rests).repaired("rest", count, text)
