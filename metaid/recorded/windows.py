"""Short windows of a log, and the equations of motion averaged over them: the weak form.

Over a window the torque is averaged with a test function ψ that ends smoothly at both ends, and so is the torque that
the model would need. Within the window the angles are a polynomial, which is integrated and differentiated exactly: no
acceleration is made of differences of readings. Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.linear_model import LinearModel
from metaid.recorded.log import Record

OVERLAP = 0.5  # of a window with the next
NODES = 32  # in a window, at which the model's torque is evaluated
AT_REST = 0.005  # of a joint's fastest speed: a window in which no joint is faster is left out
TESTS = (Polynomial([1.0, 0.0, -1.0]) ** 2, Polynomial([1.0, 0.0, -1.0]) ** 2 * Polynomial([0.0, 2.0]))  # ψ(s)


@dataclass(frozen=True)
class Windows:
    """Windows of a log, half overlapping, in which the plant moves.

    Attributes:
        span: how long each is, in s.
        middles: when each is half over (nwindow), in s.
        coordinates: of the joints at the nodes (nwindow x nnode x njoint), in rad or m.
        speeds: there (nwindow x nnode x njoint), in rad/s or m/s.
        accelerations: there (nwindow x nnode x njoint), in rad/s² or m/s².
        readings: how many there are in a window.
        noise: root mean square of what the polynomials leave of the readings (njoint), in rad or m.
    """

    span: float
    middles: Array
    coordinates: Array
    speeds: Array
    accelerations: Array
    readings: int
    noise: Array

    def __len__(self) -> int:
        return len(self.middles)

    def overlapping(self, begin: float, end: float) -> NDArray[np.bool_]:
        """Which windows (nwindow) share any time with that from `begin` to `end`, in s."""
        half = 0.5 * self.span
        return np.asarray((self.middles + half > begin) & (self.middles - half < end), dtype=np.bool_)

    def noise_share(self, noise: Array) -> Array:
        """How much of the variance of the averaged accelerations (njoint) noise of the angles is (njoint), in rad or m.

        The readings of a window are taken to be as many, and as evenly spaced, in all of them.
        """
        nodes, power = _nodes(), degree(self.span)
        weights = TESTS[0](nodes) / len(nodes)
        twice = legendre.legval(nodes, legendre.legder(np.eye(power + 1), 2)).T
        own = (np.arange(self.readings) + 0.5) / self.readings * 2.0 - 1.0
        change = weights @ twice @ np.linalg.pinv(legendre.legvander(own, power))
        from_noise = (noise * (2.0 / self.span) ** 2) ** 2 * float(change @ change)
        seen = (np.einsum("n,wnj->wj", weights, self.accelerations) ** 2).mean(axis=0)
        return np.asarray(from_noise / np.maximum(seen, 1e-300), dtype=np.float64)

    def rows(self, model: LinearModel) -> Array:
        """The averaged torque for a unit of each unknown (nwindow x ntest x njoint x nparam).  Eq. 57."""
        shape = self.coordinates.shape
        flat = (each.reshape(-1, shape[-1]) for each in (self.coordinates, self.speeds, self.accelerations))
        columns = model.regressor(*flat).reshape(*shape, -1)
        return self.averaged(columns)

    def averaged(self, at_nodes: Array) -> Array:
        """What is known at nodes (nwindow x nnode x ...), averaged by each test function (nwindow x ntest x ...)."""
        nodes = _nodes()
        weights = np.stack([test(nodes) for test in TESTS]) / len(nodes)
        return np.asarray(np.einsum("an,wn...->wa...", weights, at_nodes, optimize=True), dtype=np.float64)

    def torques(self, record: Record, delay: float = 0.0) -> Array:
        """The averaged torque that was sent (nwindow x ntest x njoint), `delay` in s later than it is logged.  Eq. 57.

        A torque holds until the next is sent.
        """
        begins = record.times + delay
        ends = np.append(begins[1:], begins[-1] + record.period)
        half = 0.5 * self.span
        averaged = np.empty((len(self), len(TESTS), record.njoint))
        integrals = [test.integ() for test in TESTS]
        firsts = np.maximum(np.searchsorted(begins, self.middles - half, side="right") - 1, 0)
        lasts = np.searchsorted(begins, self.middles + half, side="left")
        for window, (middle, first, last) in enumerate(zip(self.middles, firsts, lasts, strict=True)):
            inside = slice(first, max(last, first + 1))
            edges = np.append(begins[inside], ends[inside][-1])
            edges = np.clip((edges - middle) / half, -1.0, 1.0)
            for row, integral in enumerate(integrals):
                averaged[window, row] = 0.5 * np.diff(integral(edges)) @ record.torques[inside]
        return averaged


def degree(span: float) -> int:
    """Of the polynomial that the angles are within a window."""
    return 4 if span < 0.08 else 5 if span < 0.15 else 6


def cut_windows(record: Record, span: float, overlap: float = OVERLAP) -> Windows | None:
    """The windows of a log in which the plant moves, `span` in s long; None where there is none with readings enough.

    In a window's own time s, from −1 to 1, the angles are a sum of Legendre polynomials.
    """
    power = degree(span)
    first, last = record.times[0], record.times[-1]
    middles = np.arange(first + 0.5 * span, last - 0.5 * span, (1.0 - overlap) * span)
    nodes = _nodes()
    at_nodes = legendre.legvander(nodes, power)
    unit = np.eye(power + 1)
    once, twice = (legendre.legval(nodes, legendre.legder(unit, order)).T for order in (1, 2))
    scale = 2.0 / span
    kept, coefficients, left, counts = [], [], [], []
    for middle in middles:
        begin, end = np.searchsorted(record.times, (middle - 0.5 * span, middle + 0.5 * span))
        if end - begin < 2 * (power + 1):
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
        np.array(kept)[moves],
        coordinates[moves],
        speeds[moves],
        accelerations[moves],
        int(np.median(counts)),
        np.sqrt(np.median(left, axis=0)),
    )


def _nodes() -> Array:
    return (np.arange(NODES) + 0.5) / NODES * 2.0 - 1.0
