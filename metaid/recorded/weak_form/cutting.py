"""Windows of a log that are cut where the robot moves, with the polynomials that its angles are in each."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.reading.readings import LogRun
from metaid.recorded.weak_form.smoothed import Smoothed
from metaid.recorded.weak_form.windows import TESTS, LogWindows

DEGREES = {0.06: 4, 0.1: 5, 0.15: 4, 0.2: 6, 0.25: 4, 0.35: 4, 0.3: 8, 0.5: 10}  # by length in s, the finest first
OVERLAP = 0.5  # of a window with the next
MOST = 2_500, 10_000  # windows of a log, of robots with many joints and with few: of a longer one every second alone
NODES = 32  # in a window, at which the model's torque is evaluated
AT_REST = 0.005  # of a joint's fastest speed: a window in which no joint is faster is left out
SIDE_BY_SIDE = 50_000  # readings of windows that are fitted at once
GAP = 0.15  # of a window without a reading: nobody knows which torques were sent there
RARELY, FEW, COARSE = 0.035, 12, 4  # s between two readings, from which on windows have so many, and of which degree


def cut_windows(log: int, own: Smoothed, span: float) -> LogWindows | None:
    """The windows in which the robot moves of a `log`, which is its `own` on a grid; None where there is none with
    readings enough. Each is a `span` long, in s; of a log that is read too rarely for it, as long as FEW readings.

    In a window's own time s, from −1 to 1, the angles are a sum of Legendre polynomials.
    """
    record, power = own.record, DEGREES[min(DEGREES, key=lambda each: abs(np.log(each / span)))]
    if record.period > RARELY:
        span, power = FEW * record.period, COARSE
    first, last = record.times[0], record.times[-1]
    apart = (1.0 - OVERLAP) * span
    middles = _centred(record, np.arange(first + 0.5 * span, last - 0.5 * span, apart), span)
    middles = middles[~record.rests_at(middles)]
    most = float(np.clip(MOST[0] * (7.0 / record.njoint) ** 2, *MOST))
    if len(middles) > most:
        stride = int(np.ceil(len(middles) / most))
        middles, apart = middles[::stride], stride * apart
    nodes = (np.arange(NODES) + 0.5) / NODES * 2.0 - 1.0
    at_nodes = legendre.legvander(nodes, power)
    unit = np.eye(power + 1)
    once, twice = (legendre.legval(nodes, legendre.legder(unit, order)).T for order in (1, 2))
    scale = 2.0 / span
    fitted, left, counts = _fitted(record, middles, span, power)
    is_kept = counts > 0
    if not is_kept.any():
        return None
    coordinates, speeds, accelerations = (
        np.einsum("nk,wkj->wnj", basis, fitted[is_kept]) for basis in (at_nodes, scale * once, scale**2 * twice)
    )
    fastest = np.abs(speeds).max(axis=1)
    moves = (fastest > AT_REST * np.quantile(fastest, 0.95, axis=0)).any(axis=1) & (fastest > 0.0).any(axis=1)
    if not moves.any():
        return None
    return LogWindows(
        log,
        own,
        span,
        power,
        middles[is_kept][moves],
        coordinates[moves],
        speeds[moves],
        accelerations[moves],
        nodes,
        np.sqrt(np.median(left[is_kept], axis=0)) * scale**2 * _shaken(nodes, power, int(np.median(counts[is_kept]))),
        apart,
    )


def _shaken(nodes: Array, power: int, count: int) -> float:
    """The standard deviation of the averaged second derivative by a window's own time, for a unit of noise in each of
    so many readings, which are taken to be evenly spaced.
    """
    own = (np.arange(count) + 0.5) / count * 2.0 - 1.0
    weights = TESTS[0](nodes) / len(nodes)
    twice = legendre.legval(nodes, legendre.legder(np.eye(power + 1), 2)).T
    change = weights @ twice @ np.linalg.pinv(legendre.legvander(own, power))
    return float(np.sqrt(change @ change))


def _centred(record: LogRun, middles: Array, span: float) -> Array:
    """The middles of windows (nwindow) of a length, in s, moved by half a period at most to where their readings are as
    far to either side: accelerations of polynomials whose readings lie to one side are early or late.
    """
    begins, ends = np.searchsorted(record.times, middles + np.array([[-0.5], [0.5]]) * span)
    inner = 0.5 * (record.times[begins] + record.times[np.maximum(ends, 1) - 1])
    return np.asarray(middles + np.clip(inner - middles, -0.5 * record.period, 0.5 * record.period), dtype=np.float64)


def _fitted(record: LogRun, middles: Array, span: float, power: int) -> tuple[Array, Array, NDArray[np.intp]]:
    """The polynomials of all windows: coefficients (nwindow x power + 1 x njoint) in rad or m, variances of what they
    leave of the readings (nwindow x njoint), and how many these are (nwindow), 0 where they are too few or too far
    apart.

    Args:
        record: the log.
        middles: when each window is half over (nwindow), in s.
        span: length of a window, in s.
        power: degree of the polynomials.
    """
    before, after = middles - 0.5 * span, middles + 0.5 * span
    begins, ends = np.searchsorted(record.times, (before, after))
    counts = np.where(ends - begins >= 2 * (power + 1), ends - begins, 0)
    widest = max(GAP * span, 1.5 * record.period)  # between two readings
    coefficients, left = np.zeros((len(middles), power + 1, record.njoint)), np.zeros((len(middles), record.njoint))
    for count in np.unique(counts[counts > 0]).tolist():
        alike = np.flatnonzero(counts == count)
        for which in np.array_split(alike, -(-len(alike) * count // SIDE_BY_SIDE)):
            rows = begins[which, None] + np.arange(count)
            times = record.times[rows]
            edged = np.column_stack([before[which], times, after[which]])
            is_near = np.diff(edged, axis=1).max(axis=1) <= widest
            counts[which[~is_near]] = 0
            which, rows, times = which[is_near], rows[is_near], times[is_near]
            vandermonde = legendre.legvander((times - middles[which, None]) * (2.0 / span), power)
            transposed, begun = vandermonde.swapaxes(1, 2), record.angles[rows[:, 0]]
            readings = record.angles[rows] - begun[:, None]  # so that a joint that stands still has no speed at all
            coefficients[which] = np.linalg.solve(transposed @ vandermonde, transposed @ readings)
            errors = readings - vandermonde @ coefficients[which]
            left[which] = (errors**2).sum(axis=1) / (count - power - 1)
            coefficients[which, 0] += begun
    return coefficients, left, counts
