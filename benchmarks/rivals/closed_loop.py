"""The closed-loop output-error method along exciting trajectories: the angles of the model under the rig's servo are
fitted to those that were read.

Unknowns are log factors of the lumps and, where they are searched, friction and tilt. Each step is one of Gauss and
Newton's, by differences, from what least squares has found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.rivals.logs import Log
from benchmarks.rivals.regression import Columns, regress, searched_delay, weighted
from benchmarks.rivals.servo import follow, ideal
from benchmarks.rivals.simulated import lumps_of
from metaid.models import Array

MOST, ENOUGH, DIFFERENCE = 8, 1e-4, 1e-4
AVERAGED = 10  # steps over which angles are averaged before they are compared
TILT_UNIT, FRICTION_UNIT = 0.01, 0.01  # of unknowns that are no log factors, in rad and N m s


@dataclass(frozen=True)
class _Fit:
    """A `log` that is to be explained by a model whose torques are late by `delay` steps."""

    log: Log
    delay: int

    def columns(self, point: Array) -> Columns:
        """The model at a `point` (nunknown)."""
        searched, n = self.log.condition.searched, self.log.nominal.nlink
        count = len(self.log.nominal.lumps.vector) + n
        believed = np.append(self.log.nominal.lumps.vector, self.log.nominal.inertia_lumps)
        parameters = [believed * np.exp(point[:count])]
        if "friction" in searched:
            parameters.append(FRICTION_UNIT * point[count : count + n])
        if "tilt" in searched:
            parameters.append(TILT_UNIT * point[-1] * parameters[0][:n])
        return Columns(np.concatenate(parameters), n, searched)

    def point(self, columns: Columns) -> Array:
        """The point (nunknown) of a model; that of the nominal one where a lump is not above 0."""
        believed = np.append(self.log.nominal.lumps.vector, self.log.nominal.inertia_lumps)
        factors = np.append(columns.lumps, columns.inertia) / believed
        parts = [np.log(np.where(factors > 0.1, factors, 1.0))]
        if "friction" in columns.searched:
            parts.append(columns.friction / FRICTION_UNIT)
        if "tilt" in columns.searched:
            parts.append(np.array([columns.tilt / TILT_UNIT]))
        return np.concatenate(parts)

    def residuals(self, point: Array) -> Array | None:
        """Angles of the model less those read, averaged; None where the model is lost."""
        columns, log = self.columns(point), self.log
        steps, n = log.seen.torques.shape
        sensors = replace(ideal(steps, n, self.delay, columns.tilt), weights=log.weights)
        seen = follow(lumps_of(columns), log.gravity, log.timestep, log.servo, sensors)
        if len(seen.torques) < steps or not np.isfinite(seen.angles).all():
            return None
        off = (seen.angles - log.seen.angles)[: steps // AVERAGED * AVERAGED]
        return np.asarray(off.reshape(-1, AVERAGED, n).mean(axis=1).ravel())


def closed_loop(log: Log) -> list[Columns]:
    """What is found: one result, for no filter takes part."""
    return [_descend(_Fit(log, searched_delay(log)), regress(log, weighted)[-1])]


def _descend(fit: _Fit, begun: Columns) -> Columns:
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
    return fit.columns(point)
