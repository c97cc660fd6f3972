"""A log on a regular grid through a low-pass filter without phase: the yardstick that is the same for all.

The angles pass a Butterworth filter at ANGLES Hz, speeds and accelerations are differences of them, and both the
torques that were sent and those that a model needs pass one at a cut-off.  Eq. 73.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.reading.readings import LogRun, straight
from metaid.recorded.weak_form.linear_model import LinearModel

ANGLES = 20.0  # Hz
CUTOFFS = (10.0, 7.0, 5.0, 3.0, 2.0)  # Hz, of torques
ORDER = 4
REFLECTED = 15  # rows of each end
FINEST = 0.004  # s: the grid is no finer
LONGEST = 40_000, 200_000  # rows of a grid, of robots with many joints and with few
EDGE = 0.2  # s at both ends that are not judged
REST = 0.01  # of a joint's fastest speed: rows in which no joint is faster, for AROUND s, are not judged
AROUND = 0.25  # s
HELD = 0.1  # of what it counts else, of a joint that is held
GAP = 0.05  # s between two readings, around which rows are not judged


@dataclass(frozen=True)
class Smoothed:
    """A log on a regular grid.

    Attributes:
        record: the log as it was read.
        times: of the rows (nrow), in s.
        coordinates: through the filter (nrow x njoint), in rad or m.
        speeds: (nrow x njoint), in rad/s or m/s.
        accelerations: (nrow x njoint), in rad/s² or m/s².
        sent: the torques as they were logged, averaged over a period (nrow x njoint), in N m or N.
        fastest: the speed of each joint (njoint) that it hardly exceeds, in rad/s or m/s.
        judged: which rows count (nrow): the robot moves, and no gap is near.
        cutoff: of the torques' filter, in Hz.
        held: which joints (njoint) are held here and move in another log: stiction bears what their motors do not show.
    """

    record: LogRun
    times: Array
    coordinates: Array
    speeds: Array
    accelerations: Array
    sent: Array
    fastest: Array
    judged: NDArray[np.bool_]
    cutoff: float
    held: NDArray[np.bool_]
    _kept: dict[object, Array] = field(init=False, default_factory=dict, repr=False, compare=False)

    @property
    def period(self) -> float:
        """The time between two rows, in s."""
        return float(self.times[1] - self.times[0])

    def until(self, time: float) -> Smoothed:
        """The rows before a `time`, in s; torques fade out of the filter in a few periods of its cut-off."""
        rows = slice(int(np.searchsorted(self.times, time)))
        of_rows = ("times", "coordinates", "speeds", "accelerations", "sent", "judged")
        return replace(self, **{each: getattr(self, each)[rows] for each in of_rows})

    @cached_property
    def torques(self) -> Array:
        """The logged torques through the filter (nrow x njoint), in N m or N."""
        return self.filtered(self.sent)

    def filtered(self, torques: Array) -> Array:
        """Torques (... x nrow x njoint) through the filter."""
        rows = np.moveaxis(torques, -2, 0)
        passed = low_pass(rows.reshape(len(rows), -1), self.cutoff, self.period)
        return np.moveaxis(passed.reshape(rows.shape), 0, -2)

    def states(self, model: LinearModel) -> Array:
        """The state of dry friction along the grid (nrow x nmotor)."""
        if not model.sliding.builds_up:
            return model.sliding.at(self.speeds)
        sliding = model.sliding
        key = sliding.presliding.tobytes(), sliding.still.tobytes(), sliding.bent.tobytes(), sliding.coupled
        if key not in self._kept:
            self._kept[key] = model.sliding.along(self.coordinates, self.speeds)
        return self._kept[key]

    @property
    def share(self) -> Array:
        """By what equations of a joint (njoint) are multiplied: of one that is held here alone they count little."""
        return np.where(self.held, HELD, 1.0)

    @property
    def middle(self) -> float:
        """When half of the judged rows have passed, in s."""
        times = self.times[self.judged] if self.judged.any() else self.times
        return float(times[len(times) // 2])

    def acting(self, delay: float) -> Array:
        """The torques that acted (nrow x njoint), in N m or N, `delay` in s later than logged, through the filter."""
        if not delay:
            return self.torques
        return straight(self.times - delay, self.times, self.torques)

    def predicted(self, model: LinearModel, values: Array, zeros: Array) -> Array:
        """The torques (... x nrow x njoint) by unknowns (nparam), where the encoders have these zeros (... x njoint),
        through the filter.
        """
        rigid, friction = self.rigid(model, values[: model.nbody], zeros), model.friction_at(values)
        coordinates = self.coordinates + zeros[..., None, :]
        rubbing = friction.torque(coordinates, self.speeds, self.accelerations, rigid, self.states(model))
        return self.filtered(rigid + rubbing)

    def rigid(self, model: LinearModel, bodies: Array, zeros: Array) -> Array:
        """The torque (... x nrow x njoint), in N m or N, of bodies (nbody) alone, where the encoders have these zeros
        (... x njoint).
        """
        if zeros.any():
            return model.rigid(bodies, self.coordinates + zeros[..., None, :], self.speeds, self.accelerations)
        return np.asarray(self._columns(model) @ bodies)

    def squares(
        self, model: LinearModel, bodies: Array, torques: Array, left: Array, rows: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        """Sums of squares of what is left of torques, and of what these errors are shares of (njoint each); 0 of joints
        that are held here alone.

        Args:
            model: what is unknown.
            bodies: the unknowns of the bodies (nbody).
            torques: that acted (nrow x njoint), in N m or N.
            left: of them (nrow x njoint), in N m or N.
            rows: that count (nrow).
        """
        whole = model.whole(torques, bodies, lambda: self._columns(model))[rows].sum(axis=0)
        missed = model.trusted_alone((left[rows] ** 2).sum(axis=0))
        return np.where(self.held, 0.0, missed), np.where(self.held, 0.0, whole)

    def _columns(self, model: LinearModel) -> Array:
        """The torque for a unit of each unknown of the bodies (nrow x njoint x nbody), without zeros."""
        if model.bodies not in self._kept:
            self._kept[model.bodies] = model.bodies(self.coordinates, self.speeds, self.accelerations)
        return self._kept[model.bodies]


def low_pass(rows: Array, cutoff: float, period: float) -> Array:
    """Rows (nrow x ncolumn) that are `period` s apart through a Butterworth filter without phase at `cutoff` Hz: it
    passes forwards and backwards, and both ends go on as their reflections in the first and the last row.

    It is scipy.signal.sosfiltfilt, whose import takes as long as an estimate.
    """
    reach = min(REFLECTED, len(rows) - 1)
    before, after = 2.0 * rows[0] - rows[reach:0:-1], 2.0 * rows[-1] - rows[-2 : -reach - 2 : -1]
    passed = np.concatenate([before, rows, after])
    for _ in range(2):
        passed = _forwards(passed, min(2.0 * cutoff * period, 0.95))[::-1]
    return passed[reach : reach + len(rows)]


def _forwards(rows: Array, share: float) -> Array:
    """Rows (nrow x ncolumn) through the filter at a `share` of half the rate of reading, which has been at rest at the
    first row for ever. Each section is a banded triangular system of equations: b x = a y.
    """
    from scipy.linalg.blas import dtbsv  # slow to load

    first = rows[0]
    passed = (rows - first).T.copy()
    for gain, band in _sections(share, len(rows)):
        passed *= gain
        sums = passed.copy()
        sums[:, 1:] += 2.0 * passed[:, :-1]
        sums[:, 2:] += passed[:, :-2]
        for column in sums:
            dtbsv(2, band, column, lower=1, diag=1, overwrite_x=1)
        passed = sums
    return np.asarray(passed.T + first, dtype=np.float64)


@lru_cache(maxsize=16)
def _sections(share: float, count: int) -> tuple[tuple[float, Array], ...]:
    """The filter at a `share` of half the rate of reading as sections gain (1 + 2 z⁻¹ + z⁻²) / (1 + a z⁻¹ + b z⁻²), by
    the bilinear transform: the gain of each, and 1, a and b (3 x count) as BLAS has the matrix of so many rows.
    """
    warped = math.tan(0.5 * math.pi * share)
    sections = []
    for number in range(ORDER // 2):
        damping = 2.0 * warped * math.sin(0.5 * math.pi * (2 * number + 1) / ORDER)
        leading = 1.0 + damping + warped**2
        denominator = np.array([leading, 2.0 * (warped**2 - 1.0), 1.0 - damping + warped**2]) / leading
        sections.append((warped**2 / leading, np.asfortranarray(np.tile(denominator[:, None], count))))
    return tuple(sections)


def smoothed(record: LogRun) -> Smoothed:
    """A log on a grid with its own period, or FINEST, whose torques are averages over a period."""
    longest = float(np.clip(LONGEST[0] * (7.0 / record.njoint) ** 2, *LONGEST))
    period = max(record.period, FINEST, (record.times[-1] - record.times[0]) / longest)
    times = np.arange(record.times[0], record.times[-1], period)
    regular = np.arange(record.times[0], record.times[-1], record.period)
    angles = low_pass(straight(regular, record.times, record.angles), ANGLES, record.period)
    coordinates = straight(times, regular, angles)
    speeds = np.gradient(coordinates, period, axis=0)
    sent = mean_sent(record, np.append(times - 0.5 * period, times[-1] + 0.5 * period))
    sent[0], sent[-1] = record.torques[0], record.torques[-1]
    fastest: Array = np.quantile(np.abs(speeds), 0.99, axis=0)
    moves = (np.abs(speeds) > REST * fastest) & (fastest > 0.0)
    return Smoothed(
        record,
        times,
        coordinates,
        speeds,
        np.gradient(speeds, period, axis=0),
        sent,
        fastest,
        _judged(record, times, moves),
        CUTOFFS[0],
        np.zeros(record.njoint, dtype=np.bool_),
    )


def mean_sent(record: LogRun, edges: Array) -> Array:
    """The means of a log's torques (... x nperiod x njoint), in N m or N, each of which holds until the next is sent,
    between `edges` (... x nperiod + 1), in s.
    """
    sums = np.vstack([np.zeros(record.njoint), np.cumsum(record.torques[:-1] * np.diff(record.times)[:, None], axis=0)])
    means = np.diff(straight(edges, record.times, sums), axis=-2) / np.diff(edges)[..., None]
    return np.asarray(means, dtype=np.float64)


def smoothed_together(records: Sequence[LogRun], model: LinearModel) -> tuple[Smoothed, ...]:
    """Logs of one robot on their grids, each with the joints that are held in it and not in all."""
    logs = [smoothed(record) for record in records]
    held = _held(logs, model)
    return tuple(replace(own, held=each & ~held.all(axis=0)) for own, each in zip(logs, held, strict=True))


def smoothed_beside(logs: Sequence[Smoothed], record: LogRun, model: LinearModel) -> Smoothed:
    """Another log of that robot on its grid, through their filter, with the joints that are held in it and not in all
    of these `logs`.
    """
    own = smoothed(record)
    (held,) = _held([own], model)
    return replace(own, cutoff=logs[0].cutoff, held=held & ~_held(logs, model).all(axis=0))


def _held(logs: Sequence[Smoothed], model: LinearModel) -> NDArray[np.bool_]:
    """Which joints are held in which log (nlog x njoint)."""
    return np.array([model.held(np.ptp(own.coordinates, axis=0)) for own in logs])


def _judged(record: LogRun, times: Array, moves: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Rows (nrow), at `times` in s, near which a joint `moves` (nrow x njoint) and whose neighbours were all read."""
    period = times[1] - times[0]
    reach = min(2 * max(1, round(AROUND / period)) + 1, len(times))
    rests = record.rests_at(times) & record.rests_at(times - AROUND) & record.rests_at(times + AROUND)
    judged = (np.convolve(moves.any(axis=1).astype(np.float64), np.ones(reach), mode="same") > 0.5) & ~rests
    judged &= (times > times[0] + EDGE) & (times < times[-1] - EDGE)
    for late in np.flatnonzero(np.diff(record.times) > max(GAP, 3.0 * record.period)):
        judged &= (times < record.times[late] - EDGE) | (times > record.times[late + 1] + EDGE)
    return np.asarray(judged, dtype=np.bool_)
