"""The windows of one log: the averaged torque for a unit of each unknown, and what friction that grows with load needs.

Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from metaid.models import Array
from metaid.recorded.reading.readings import straight
from metaid.recorded.weak_form.linear_model import LinearModel
from metaid.recorded.weak_form.smoothed import Smoothed
from metaid.recorded.weak_form.windows import LogWindows

SHIFT = 1e-5  # rad or m, for derivatives by a zero, and by where a joint is
CHUNK = 2_000_000  # numbers at nodes that are made at a time


@dataclass(frozen=True)
class Part:
    """The windows of one log.

    Attributes:
        log: which of the logs.
        windows: of it.
        smoothed: the log on a regular grid, from whose angles the state of dry friction follows.
    """

    log: int
    windows: LogWindows
    smoothed: Smoothed

    def rows(self, model: LinearModel, load: Array, zeros: Array) -> Array:
        """The averaged torque for a unit of each unknown (nwindow x ntest x njoint x nparam).  Eq. 65.

        Args:
            model: what is unknown.
            load: the torque at nodes with which friction grows (nwindow x nnode x njoint), in N m or N.
            zeros: of the encoders (njoint), in rad.
        """
        averaged, windows = self._averaged(model, zeros), self.windows
        friction = model.friction_columns(
            windows.coordinates + zeros, windows.speeds, windows.accelerations, self.sliding(model), load
        )
        rows: Array = self.smoothed.share[:, None] * np.concatenate([averaged, windows.averaged(friction)], axis=-1)
        return rows

    def torques(self, delay: float) -> Array:
        """The averaged torques (nwindow x ntest x njoint), in N m or N, `delay` in s later than they are logged."""
        return self.windows.torques(self.smoothed.record, delay) * self.smoothed.share

    def _averaged(self, model: LinearModel, zeros: Array) -> Array:
        """The averaged torque for a unit of each of the bodies' unknowns (nwindow x ntest x njoint x nbody), kept for
        the first zeros and the last. What is at all nodes for each unknown would not fit into memory.
        """
        windows, kept, key = self.windows, self.windows.kept, (model.bodies, zeros.tobytes())
        if key not in kept:
            if len(kept) > 1:
                kept.popitem()
            count = -(-windows.speeds.size * model.nbody // CHUNK)
            chunks = [windows.only(own) for own in np.array_split(np.arange(len(windows)), count)]
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
            return model.sliding.at(self.windows.speeds)
        return straight(self.windows.times, self.smoothed.times, self.smoothed.states(model))

    def zero_columns(self, model: LinearModel, values: Array, zeros: Array) -> Array:
        """How the averaged torque by unknowns (nparam) changes with each zero (nwindow x ntest x njoint x njoint)."""
        windows, n = self.windows.thinned(), model.njoint
        shifts = SHIFT * np.vstack([np.zeros(n), np.eye(n)])
        moved = windows.coordinates + (zeros + shifts)[:, None, None]
        bodies, springs = values[: model.nbody], model.friction_at(values).of("spring")[:n]
        needed = model.rigid(bodies, moved, windows.speeds, windows.accelerations) + springs * moved
        usual, *others = map(windows.averaged, needed)
        return np.stack([(each - usual) / SHIFT for each in others], axis=-1)


def loads_of(parts: Sequence[Part], model: LinearModel, bodies: Array, zeros: Array) -> list[Array]:
    """The torque of bodies at the nodes of each log (nwindow x nnode x njoint), in N m or N; 0 where no friction grows
    with it. Logs are taken together, for short ones take as long as long ones.

    Args:
        parts: the windows of each.
        model: what is unknown.
        bodies: its unknowns of the bodies (nbody).
        zeros: of the encoders of all logs (nlog x njoint), in rad.
    """
    shapes = [part.windows.speeds.shape for part in parts]
    if "load" not in model.friction:
        return [np.zeros(shape) for shape in shapes]
    windows = [part.windows for part in parts]
    coordinates = [each.coordinates + zeros[part.log] for part, each in zip(parts, windows, strict=True)]
    motion = coordinates, [each.speeds for each in windows], [each.accelerations for each in windows]
    flat = [np.concatenate([each.reshape(-1, model.njoint) for each in own]) for own in motion]
    count = -(-flat[0].size * model.nbody // CHUNK)
    chunks = zip(*(np.array_split(each, count) for each in flat), strict=True)
    loads = np.concatenate([model.rigid(bodies, *chunk) for chunk in chunks])
    edges = np.cumsum([np.prod(shape[:-1]) for shape in shapes])[:-1]
    return [load.reshape(shape) for load, shape in zip(np.split(loads, edges), shapes, strict=True)]
