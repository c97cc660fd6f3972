"""The closed-loop output-error method along exciting trajectories: the angles of the model under the rig's servo are
fitted to those that were read.

Each step is one of Gauss and Newton's, by differences, from what least squares has found. Unknowns are those of the
model, and the offsets of encoders where they are searched. What is believed of an arm counts as it does in regression.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.rivals.logs import Log
from benchmarks.rivals.regression import Beforehand, motions, rows_of, search_beforehand, weighted
from benchmarks.rivals.servo import Sensors
from metaid.models import Array

MOST, ENOUGH, DIFFERENCE = 8, 1e-4, 1e-4
AVERAGED = 10  # steps over which angles are averaged before they are compared
OFFSET_UNIT = 0.01  # of unknown offsets, in rad


@dataclass(frozen=True)
class _Fit:
    """A `log` that is to be explained by a model, and what was `known` of it beforehand."""

    log: Log
    known: Beforehand

    @property
    def _offsets(self) -> int:
        """How many of the unknowns, the last, are offsets of encoders."""
        return len(self.known.offset) if "offset" in self.log.condition.searched else 0

    def parameters(self, point: Array) -> Array:
        """Of the model at a `point` (nunknown)."""
        return self.log.model.parameters_at(point[: len(point) - self._offsets])

    def point(self, parameters: Array) -> Array:
        """The point (nunknown) of a model."""
        return np.append(self.log.model.point(parameters), self.known.offset[: self._offsets] / OFFSET_UNIT)

    def residuals(self, point: Array) -> Array | None:
        """Angles of the model less those read, averaged; None where the model is lost."""
        log, offset = self.log, OFFSET_UNIT * point[len(point) - self._offsets :]
        steps, n = log.seen.torques.shape
        sensors = Sensors(offset if self._offsets else np.zeros(n), log.weights, self.known.delay)
        seen = log.model.follow(self.parameters(point), log.servo, sensors)
        if seen is None or len(seen.torques) < steps or not np.isfinite(seen.angles).all():
            return None
        off = (seen.angles - log.seen.angles)[: steps // AVERAGED * AVERAGED]
        averaged = off.reshape(-1, AVERAGED, n).mean(axis=1).ravel()
        if not len(log.model.prior):
            return np.asarray(averaged)
        return np.append(averaged, log.condition.settings.angle_noise / np.sqrt(AVERAGED) * point)


def closed_loop(log: Log) -> list[Array]:
    """The parameters that are found: one result, for no filter takes part."""
    known = search_beforehand(log)
    widest = motions(log, log.seen.angles, log.seen.speeds, known)[-1]
    return [_descend(_Fit(log, known), weighted(rows_of(log, widest)))]


def _descend(fit: _Fit, begun: Array) -> Array:
    """Gauss and Newton's steps, halved where they lead upwards."""
    point = fit.point(begun)
    values = fit.residuals(point)
    if values is None:
        return begun
    for _ in range(MOST):
        moved = [fit.residuals(point + DIFFERENCE * unit) for unit in np.eye(len(point))]
        if any(each is None for each in moved):
            break
        slopes = np.stack([(each - values) / DIFFERENCE for each in moved if each is not None], axis=1)
        step = np.asarray(np.linalg.lstsq(slopes, -values)[0])
        step *= min(1.0, 0.5 / float(np.abs(step).max()))
        for _ in range(5):
            tried = fit.residuals(point + step)
            if tried is not None and tried @ tried < values @ values:
                break
            step = step / 2.0
        else:
            break
        point, values = point + step, tried
        if np.abs(step).max() < ENOUGH:
            break
    return fit.parameters(point)
