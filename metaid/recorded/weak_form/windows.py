"""Short windows of a log, and the equations of motion averaged over them: the weak form.

Over a window the torque is averaged with a test function ψ that ends smoothly at both ends, and so is the torque that
the model would need. Within the window the angles are a polynomial, which is integrated and differentiated exactly: no
acceleration is made of differences of readings. Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.reading.readings import straight
from metaid.recorded.weak_form.linear_model import LinearModel
from metaid.recorded.weak_form.smoothed import Smoothed

SHIFT = 1e-5  # rad or m, for derivatives by a zero, and by where a joint is
CHUNK = 2_000_000  # numbers at nodes that are made at a time
THINNED = 4  # one of so many nodes, where a torque need not be known as exactly
TESTS = (Polynomial([1.0, 0.0, -1.0]) ** 2, Polynomial([1.0, 0.0, -1.0]) ** 2 * Polynomial([0.0, 2.0]))  # ψ(s)
ODD, EVEN = TESTS[0].integ().coef[1::2], TESTS[1].integ().coef[::2]  # coefficients of their integrals that are not 0


@dataclass(frozen=True)
class LogWindows:
    """Windows of a log, half overlapping, in which the plant moves.

    Attributes:
        log: which of the logs.
        smoothed: it on a regular grid, from whose angles the state of dry friction follows.
        span: how long each is, in s.
        degree: of the polynomials that the angles are within a window.
        middles: when each is half over (nwindow), in s.
        coordinates: of the joints at the nodes (nwindow x nnode x njoint), in rad or m.
        speeds: there (nwindow x nnode x njoint), in rad/s or m/s.
        accelerations: there (nwindow x nnode x njoint), in rad/s² or m/s².
        nodes: in a window's own time, from −1 to 1 (nnode).
        acceleration_noise: standard deviation of averaged accelerations (njoint) that the noise of the angles makes, in
            rad/s² or m/s².
        apart: the time from one window to the next, in s.
        kept: what was averaged over them, that takes long; windows with another motion keep their own.
    """

    log: int
    smoothed: Smoothed
    span: float
    degree: int
    middles: Array
    coordinates: Array
    speeds: Array
    accelerations: Array
    nodes: Array
    acceleration_noise: Array
    apart: float
    kept: dict[tuple[object, bytes], Array] = field(default_factory=dict, repr=False, compare=False)

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
        return replace(self, coordinates=coordinates, speeds=speeds, accelerations=accelerations, kept={})

    def shifted(self, offsets: Array) -> LogWindows:
        """The same with coordinates that are shifted (njoint), in rad or m."""
        return replace(self, coordinates=self.coordinates + offsets, kept={})

    @property
    def times(self) -> Array:
        """When each node is (nwindow x nnode), in s."""
        return np.asarray(self.middles[:, None] + 0.5 * self.span * self.nodes, dtype=np.float64)

    def averaged(self, at_nodes: Array) -> Array:
        """What is known at nodes (nwindow x nnode x ...), averaged by each test function (nwindow x ntest x ...)."""
        weights = np.stack([test(self.nodes) for test in TESTS]) / len(self.nodes)
        averaged: Array = weights @ at_nodes.reshape(*at_nodes.shape[:2], -1)
        return averaged.reshape(len(at_nodes), len(TESTS), *at_nodes.shape[2:])

    def torques(self, delay: float) -> Array:
        """The averaged torques that were sent (nwindow x ntest x njoint), in N m or N, `delay` in s later than they are
        logged.  Eq. 65.

        A torque holds until the next is sent.
        """
        record = self.smoothed.record
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
        return averaged * self.smoothed.share

    def rows(self, model: LinearModel, load: Array, zeros: Array) -> Array:
        """The averaged torque for a unit of each unknown (nwindow x ntest x njoint x nparam).  Eq. 65.

        Args:
            model: what is unknown.
            load: the torque at nodes with which friction grows (nwindow x nnode x njoint), in N m or N.
            zeros: of the encoders (njoint), in rad.
        """
        bodies = self._averaged(model, zeros)
        motion = self.coordinates + zeros, self.speeds, self.accelerations
        friction = self.averaged(model.friction_columns(*motion, self.sliding(model), load))
        rows: Array = self.smoothed.share[:, None] * np.concatenate([bodies, friction], axis=-1)
        return rows

    def _averaged(self, model: LinearModel, zeros: Array) -> Array:
        """The averaged torque for a unit of each of the bodies' unknowns (nwindow x ntest x njoint x nbody), kept for
        the first zeros and the last. What is at all nodes for each unknown would not fit into memory.
        """
        kept, key = self.kept, (model.bodies, zeros.tobytes())
        if key not in kept:
            if len(kept) > 1:
                kept.popitem()
            count = -(-self.speeds.size * model.nbody // CHUNK)
            chunks = [self.only(own) for own in np.array_split(np.arange(len(self)), count)]
            rows = (model.bodies(own.coordinates + zeros, own.speeds, own.accelerations) for own in chunks)
            kept[key] = np.concatenate([own.averaged(each) for own, each in zip(chunks, rows, strict=True)])
        averaged: Array = kept[key]
        return averaged

    def whole(self, model: LinearModel, bodies: Array, torques: Array) -> Array:
        """What errors of averaged `torques` (nwindow x ntest x njoint) are shares of, squared, by bodies (nbody)."""
        return model.whole(torques, bodies, lambda: self._averaged(model, np.zeros(model.njoint)))

    def sliding(self, model: LinearModel) -> Array:
        """The state of dry friction at nodes (nwindow x nnode x nmotor)."""
        if not model.sliding.builds_up:
            return model.sliding.at(self.speeds)
        return straight(self.times, self.smoothed.times, self.smoothed.states(model))

    def zero_columns(self, model: LinearModel, values: Array, zeros: Array) -> Array:
        """How the averaged torque by unknowns (nparam) changes with each zero (nwindow x ntest x njoint x njoint)."""
        windows, n = self.thinned(), model.njoint
        shifts = SHIFT * np.vstack([np.zeros(n), np.eye(n)])
        moved = windows.coordinates + (zeros + shifts)[:, None, None]
        bodies, springs = values[: model.nbody], model.friction_at(values).of("spring")[:n]
        needed = model.rigid(bodies, moved, windows.speeds, windows.accelerations) + springs * moved
        usual, *others = map(windows.averaged, needed)
        return np.stack([(each - usual) / SHIFT for each in others], axis=-1)


def loads_of(parts: Sequence[LogWindows], model: LinearModel, bodies: Array, zeros: Array) -> list[Array]:
    """The torque of bodies at the nodes of each log (nwindow x nnode x njoint), in N m or N; 0 where no friction grows
    with it. Logs are taken together, for short ones take as long as long ones.

    Args:
        parts: the windows of each.
        model: what is unknown.
        bodies: its unknowns of the bodies (nbody).
        zeros: of the encoders of all logs (nlog x njoint), in rad.
    """
    shapes = [part.speeds.shape for part in parts]
    if "load" not in model.friction:
        return [np.zeros(shape) for shape in shapes]
    coordinates = [part.coordinates + zeros[part.log] for part in parts]
    motion = coordinates, [part.speeds for part in parts], [part.accelerations for part in parts]
    flat = [np.concatenate([each.reshape(-1, model.njoint) for each in own]) for own in motion]
    loads = model.rigid(bodies, *flat)
    edges = np.cumsum([np.prod(shape[:-1]) for shape in shapes])[:-1]
    return [load.reshape(shape) for load, shape in zip(np.split(loads, edges), shapes, strict=True)]
