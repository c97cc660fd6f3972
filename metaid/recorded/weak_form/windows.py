"""Short windows of a log, and the equations of motion averaged over them: the weak form.

Over a window the torque is averaged with a test function ψ that ends smoothly at both ends, and so is the torque that
the model would need. Within the window the angles are a polynomial, which is integrated and differentiated exactly: no
acceleration is made of differences of readings. Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.reading.readings import LogRun

DEGREES = {0.06: 4, 0.1: 5, 0.15: 4, 0.2: 6, 0.25: 4, 0.35: 4, 0.3: 8, 0.5: 10}  # by length in s, the finest first
OVERLAP = 0.5  # of a window with the next
MOST = 2_500, 10_000  # windows of a log, of robots with many joints and with few: of a longer one every second alone
NODES = 32  # in a window, at which the model's torque is evaluated
THINNED = 4  # one of so many nodes, where a torque need not be known as exactly
AT_REST = 0.005  # of a joint's fastest speed: a window in which no joint is faster is left out
SIDE_BY_SIDE = 50_000  # readings of windows that are fitted at once
GAP = 0.15  # of a window without a reading: nobody knows which torques were sent there
RARELY, FEW, COARSE = 0.035, 12, 4  # s between two readings, from which on windows have so many, and of which degree
TESTS = (Polynomial([1.0, 0.0, -1.0]) ** 2, Polynomial([1.0, 0.0, -1.0]) ** 2 * Polynomial([0.0, 2.0]))  # ψ(s)
ODD, EVEN = TESTS[0].integ().coef[1::2], TESTS[1].integ().coef[::2]  # coefficients of their integrals that are not 0


@dataclass(frozen=True)
class LogWindows:
    """Windows of a log, half overlapping, in which the plant moves.

    Attributes:
        span: how long each is, in s.
        degree: of the polynomials that the angles are within a window.
        middles: when each is half over (nwindow), in s.
        coordinates: of the joints at the nodes (nwindow x nnode x njoint), in rad or m.
        speeds: there (nwindow x nnode x njoint), in rad/s or m/s.
        accelerations: there (nwindow x nnode x njoint), in rad/s² or m/s².
        nodes: in a window's own time, from −1 to 1 (nnode).
        readings: how many there are in a window.
        noise: root mean square of what the polynomials leave of the readings (njoint), in rad or m.
        apart: the time from one window to the next, in s.
        kept: what was averaged over them, that takes long, for `Part`; others made of these keep their own.
    """

    span: float
    degree: int
    middles: Array
    coordinates: Array
    speeds: Array
    accelerations: Array
    nodes: Array
    readings: int
    noise: Array
    apart: float
    kept: dict[tuple[object, bytes], Array] = field(init=False, default_factory=dict, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.middles)

    def overlapping(self, begin: float, end: float) -> NDArray[np.bool_]:
        """Which windows (nwindow) share any time with that from `begin` to `end`, in s."""
        half = 0.5 * self.span
        return np.asarray((self.middles + half > begin) & (self.middles - half < end), dtype=np.bool_)

    def only(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> LogWindows:
        """Those of `which` (nwindow), or of these numbers."""
        return replace(self.mapped(lambda each: each[which]), middles=self.middles[which])

    def thinned(self) -> LogWindows:
        """The same with few nodes."""
        kept = slice(THINNED // 2, None, THINNED)
        return replace(self.mapped(lambda each: each[:, kept]), nodes=self.nodes[kept])

    def mapped(self, change: Callable[[Array], Array]) -> LogWindows:
        """The same with coordinates, speeds and accelerations (nwindow x nnode x njoint each) changed in the same
        way.
        """
        coordinates, speeds, accelerations = map(change, (self.coordinates, self.speeds, self.accelerations))
        return replace(self, coordinates=coordinates, speeds=speeds, accelerations=accelerations)

    @property
    def times(self) -> Array:
        """When each node is (nwindow x nnode), in s."""
        return np.asarray(self.middles[:, None] + 0.5 * self.span * self.nodes, dtype=np.float64)

    @property
    def acceleration_noise(self) -> Array:
        """Standard deviation of averaged accelerations (njoint) that the noise of the angles makes, in rad/s² or m/s².

        The readings of a window are taken to be as many, and as evenly spaced, in all of them.
        """
        nodes = self.nodes
        weights = TESTS[0](nodes) / len(nodes)
        twice = legendre.legval(nodes, legendre.legder(np.eye(self.degree + 1), 2)).T
        own = (np.arange(self.readings) + 0.5) / self.readings * 2.0 - 1.0
        change = weights @ twice @ np.linalg.pinv(legendre.legvander(own, self.degree))
        return np.asarray(self.noise * (2.0 / self.span) ** 2 * float(np.sqrt(change @ change)), dtype=np.float64)

    def averaged(self, at_nodes: Array) -> Array:
        """What is known at nodes (nwindow x nnode x ...), averaged by each test function (nwindow x ntest x ...)."""
        weights = np.stack([test(self.nodes) for test in TESTS]) / len(self.nodes)
        averaged: Array = weights @ at_nodes.reshape(*at_nodes.shape[:2], -1)
        return averaged.reshape(len(at_nodes), len(TESTS), *at_nodes.shape[2:])

    def torques(self, record: LogRun, delay: float) -> Array:
        """The averaged torque that was sent (nwindow x ntest x njoint), `delay` in s later than it is logged.  Eq. 65.

        A torque holds until the next is sent.
        """
        begins = record.times + delay
        ends = np.append(begins, begins[-1] + record.period)
        half = 0.5 * self.span
        firsts = np.maximum(np.searchsorted(begins, self.middles - half, side="right") - 1, 0)
        lasts = np.searchsorted(begins, self.middles + half, side="left")
        reach = int((lasts - firsts).max(initial=1))
        rows = np.minimum(firsts[:, None] + np.arange(reach + 1), len(begins))
        edges = np.clip((ends[rows] - self.middles[:, None]) / half, -1.0, 1.0)  # what is outside has no width
        squares = edges**2
        integrals = np.stack([edges * polyval(squares, ODD), polyval(squares, EVEN)], axis=1)
        weights = 0.5 * (integrals[..., 1:] - integrals[..., :-1])
        sent = record.torques[np.minimum(rows[:, :-1], len(begins) - 1)]
        averaged: Array = weights @ sent
        return averaged


def cut_windows(record: LogRun, span: float) -> LogWindows | None:
    """The windows of a log in which the robot moves; None where there is none with readings enough. Each has a length
    of `span`, in s; of a log that is read too rarely for it, of FEW readings.

    In a window's own time s, from −1 to 1, the angles are a sum of Legendre polynomials.
    """
    power = DEGREES[min(DEGREES, key=lambda each: abs(np.log(each / span)))]
    if record.period > RARELY:
        span, power = FEW * record.period, COARSE
    first, last = record.times[0], record.times[-1]
    apart = (1.0 - OVERLAP) * span
    middles = np.arange(first + 0.5 * span, last - 0.5 * span, apart)
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
        span,
        power,
        middles[is_kept][moves],
        coordinates[moves],
        speeds[moves],
        accelerations[moves],
        nodes,
        int(np.median(counts[is_kept])),
        np.sqrt(np.median(left[is_kept], axis=0)),
        apart,
    )


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
