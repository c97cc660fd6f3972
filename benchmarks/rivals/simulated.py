"""Methods that simulate the estimate under the very servo that drove the rig, and need no filtered derivatives.

DIDIM (Gautier, Janot and Vandanjon, 2013): the commanded torques are regressed on the simulated motion, over and over.
Both begin at weighted least squares.
Instrumental variables (Janot, Vandanjon and Gautier, 2014): the simulated motion makes the instruments of a regression
on the measured one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.recording import Recording
from benchmarks.rivals.logs import Log
from benchmarks.rivals.regression import Columns, motions, regressor, searched_delay, weighted, whitened
from benchmarks.rivals.servo import follow, ideal
from metaid.models import Array, Lumps

SPANS = (0.4, 0.8)  # of the filters, in natural times: wider and narrower ones are no better
MOST, ENOUGH = 6, 1e-4  # rounds, and a change of every lump between two, as a share of it, with which they end


def lumps_of(columns: Columns) -> Lumps:
    """The chain that a regression found."""
    n = columns.nlink
    coriolis = np.zeros((n, n))
    coriolis[np.triu_indices(n, 1)] = columns.lumps[n:]
    return Lumps(columns.lumps[:n], coriolis + coriolis.T, damping=columns.friction, inertia=columns.inertia)


def simulate(log: Log, columns: Columns, delay: int) -> list[Recording]:
    """The motion of a model under the servo of a log, with the torques of the log, by each filter; none where the model
    cannot follow it.
    """
    steps, n = log.seen.torques.shape
    sensors = replace(ideal(steps, n, delay, columns.tilt), weights=log.weights)
    if not np.all(columns.inertia > 0.0):
        return []
    seen = follow(lumps_of(columns), log.gravity, log.timestep, log.servo, sensors)
    return motions(log, seen.angles, seen.speeds, delay, SPANS) if len(seen.torques) == steps else []


def didim(log: Log) -> list[Columns]:
    """What it finds with each filter, which the torques and the simulated motion pass alike."""
    delay, found = searched_delay(log), []
    for number, measured in enumerate(motions(log, log.seen.angles, log.seen.speeds, delay, SPANS)):
        rows = regressor(measured, log.gravity, log.condition.searched), measured.torques
        columns = Columns(weighted(rows), log.nominal.nlink, log.condition.searched)
        for _ in range(MOST):
            simulated = simulate(log, columns, delay)
            if not simulated:
                break
            motion = simulated[number]
            before = columns
            rows = regressor(motion, log.gravity, columns.searched), motion.torques
            columns = replace(columns, parameters=weighted(rows))
            if _is_settled(before, columns):
                break
        found.append(columns)
    return found


def instrumental(log: Log) -> list[Columns]:
    """What instrumental variables find with each filter."""
    delay, found = searched_delay(log), []
    for number, measured in enumerate(motions(log, log.seen.angles, log.seen.speeds, delay, SPANS)):
        rows = regressor(measured, log.gravity, log.condition.searched), measured.torques
        columns = Columns(weighted(rows), log.nominal.nlink, log.condition.searched)
        for _ in range(MOST):
            simulated = simulate(log, columns, delay)
            if not simulated:
                break
            before = columns
            instruments = regressor(simulated[number], log.gravity, columns.searched)
            columns = replace(columns, parameters=_instrumental(rows, instruments, columns.parameters))
            if _is_settled(before, columns):
                break
        found.append(columns)
    return found


def _instrumental(rows: tuple[Array, Array], instruments: Array, parameters: Array) -> Array:
    """(Zᵀ X)⁻¹ Zᵀ τ, all of them whitened by what the `parameters` leave."""
    matrix, torques = whitened(rows, parameters)
    shown, _ = whitened((instruments, rows[1] - (rows[0] - instruments) @ parameters), parameters)
    count = matrix.shape[2]
    matrix, shown = matrix.reshape(-1, count), shown.reshape(-1, count)
    scale = np.linalg.norm(matrix, axis=0)
    matrix, shown = matrix / scale, shown / scale
    return np.asarray(np.linalg.lstsq(shown.T @ matrix, shown.T @ torques.ravel())[0] / scale)


def _is_settled(before: Columns, after: Columns) -> bool:
    return bool(np.abs(after.lumps / before.lumps - 1.0).max() < ENOUGH)
