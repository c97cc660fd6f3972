"""Short windows of a log, and the equations of motion averaged over them: the weak form.

Over a window the torque is averaged with a test function ψ that ends smoothly at both ends, and so is the torque that
the model would need. Within the window the angles are a polynomial, which is integrated and differentiated exactly: no
acceleration is made of differences of readings. Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.reading.log import Record

OVERLAP = 0.5  # of a window with the next
MOST = 2_500, 10_000  # windows of a log, of robots with many joints and with few: of a longer one every second alone
NODES = 32  # in a window, at which the model's torque is evaluated
AT_REST = 0.005  # of a joint's fastest speed: a window in which no joint is faster is left out
GAP = 0.15  # of a window without a reading: nobody knows which torques were sent there
TESTS = (Polynomial([1.0, 0.0, -1.0]) ** 2, Polynomial([1.0, 0.0, -1.0]) ** 2 * Polynomial([0.0, 2.0]))  # ψ(s)


@dataclass(frozen=True)
class Windows:
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

    def __len__(self) -> int:
        return len(self.middles)

    def overlapping(self, begin: float, end: float) -> NDArray[np.bool_]:
        """Which windows (nwindow) share any time with that from `begin` to `end`, in s."""
        half = 0.5 * self.span
        return np.asarray((self.middles + half > begin) & (self.middles - half < end), dtype=np.bool_)

    def only(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> Windows:
        """Those of `which` (nwindow), or of these numbers."""
        return replace(
            self,
            middles=self.middles[which],
            coordinates=self.coordinates[which],
            speeds=self.speeds[which],
            accelerations=self.accelerations[which],
        )

    def thinned(self, every: int) -> Windows:
        """The same with one of `every` nodes."""
        kept = slice(every // 2, None, every)
        return replace(
            self,
            coordinates=self.coordinates[:, kept],
            speeds=self.speeds[:, kept],
            accelerations=self.accelerations[:, kept],
            nodes=self.nodes[kept],
        )

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
        return np.asarray(np.einsum("an,wn...->wa...", weights, at_nodes, optimize=True), dtype=np.float64)

    def torques(self, record: Record, delay: float = 0.0) -> Array:
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
        weights = np.stack([0.5 * np.diff(test.integ()(edges), axis=1) for test in TESTS], axis=1)
        sent = record.torques[np.minimum(rows[:, :-1], len(begins) - 1)]
        averaged: Array = weights @ sent
        return averaged


def cut_windows(record: Record, span: float, power: int, overlap: float = OVERLAP) -> Windows | None:
    """The windows of a log in which the robot moves; None where there is none with readings enough.

    In a window's own time s, from −1 to 1, the angles are a sum of Legendre polynomials.

    Args:
        record: the log.
        span: length of a window, in s.
        power: degree of the polynomials.
        overlap: of a window with the next.
    """
    first, last = record.times[0], record.times[-1]
    apart = (1.0 - overlap) * span
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
    widest = max(GAP * span, 1.5 * record.period)  # between two readings
    kept, coefficients, left, counts = [], [], [], []
    for middle in middles:
        begin, end = np.searchsorted(record.times, (middle - 0.5 * span, middle + 0.5 * span))
        if end - begin < 2 * (power + 1):
            continue
        edges = middle - 0.5 * span, middle + 0.5 * span
        if np.diff(record.times[begin:end], prepend=edges[0], append=edges[1]).max() > widest:
            continue
        own = scale * (record.times[begin:end] - middle)
        readings = record.angles[begin:end]
        vandermonde = legendre.legvander(own, power)
        fitted = np.linalg.lstsq(vandermonde, readings, rcond=None)[0]
        kept.append(middle)
        counts.append(end - begin)
        coefficients.append(fitted)
        left.append(((readings - vandermonde @ fitted) ** 2).sum(axis=0) / (end - begin - power - 1))
    if not kept:
        return None
    stacked = np.array(coefficients)
    coordinates, speeds, accelerations = (
        np.einsum("nk,wkj->wnj", basis, stacked) for basis in (at_nodes, scale * once, scale**2 * twice)
    )
    fastest = np.abs(speeds).max(axis=1)
    moves = (fastest > AT_REST * np.quantile(fastest, 0.95, axis=0)).any(axis=1) & (fastest > 0.0).any(axis=1)
    if not moves.any():
        return None
    return Windows(
        span,
        power,
        np.array(kept)[moves],
        coordinates[moves],
        speeds[moves],
        accelerations[moves],
        nodes,
        int(np.median(counts)),
        np.sqrt(np.median(left, axis=0)),
        apart,
    )
