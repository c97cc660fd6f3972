"""Methods that simulate the estimate under the very servo that drove the rig, and need no filtered derivatives.

DIDIM (Gautier, Janot and Vandanjon, 2013): the commanded torques are regressed on the simulated motion, over and over.
Instrumental variables (Janot, Vandanjon and Gautier, 2014): the simulated motion makes the instruments of a regression
on the measured one. Both begin at weighted least squares.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.rivals.logs import Log
from benchmarks.rivals.models import Motion
from benchmarks.rivals.regression import Beforehand, Rows, motions, rows_of, search_beforehand, weighted, whitened
from benchmarks.rivals.servo import Sensors
from metaid.models import Array

SPANS = (0.4, 0.8)  # of the filters, in natural times: wider and narrower ones are no better
MOST, ENOUGH = 6, 1e-4  # rounds, and a change of every unknown of a descent between two with which they end


def simulate(log: Log, parameters: Array, known: Beforehand) -> list[Motion]:
    """The motion of a model under the servo of a log, with the torques of the log, by each filter; none where the model
    cannot follow it.
    """
    seen = log.model.follow(parameters, log.servo, Sensors(known.offset, log.weights, known.delay))
    if seen is None or len(seen.torques) < len(log.seen.torques) or not np.isfinite(seen.angles).all():
        return []
    return motions(log, seen.angles, seen.speeds, known, SPANS)


def didim(log: Log) -> list[Array]:
    """The parameters that it finds with each filter, which the torques and the simulated motion pass alike."""
    return _repeated(log, lambda measured, simulated, parameters: weighted(simulated))


def instrumental(log: Log) -> list[Array]:
    """The parameters that instrumental variables find with each filter."""
    return _repeated(log, _instrumental)


def _repeated(log: Log, solve: Callable[[Rows, Rows, Array], Array]) -> list[Array]:
    """What is found with each filter: weighted least squares, then over and over what `solve` makes of the measured
    rows, those of the simulated motion, and the parameters before.
    """
    known, found = search_beforehand(log), []
    for number, measured in enumerate(motions(log, log.seen.angles, log.seen.speeds, known, SPANS)):
        rows = rows_of(log, measured)
        parameters = weighted(rows)
        for _ in range(MOST):
            simulated = simulate(log, parameters, known)
            if not simulated:
                break
            before, parameters = parameters, solve(rows, rows_of(log, simulated[number]), parameters)
            if np.abs(log.model.point(parameters) - log.model.point(before)).max() < ENOUGH:
                break
        found.append(parameters)
    return found


def _instrumental(rows: Rows, simulated: Rows, parameters: Array) -> Array:
    """(Zᵀ X)⁻¹ Zᵀ τ, all of them whitened by what the `parameters` leave, with what is believed."""
    instruments, count = simulated.regressor, rows.regressor.shape[2]
    white = whitened(rows, parameters)
    shown = whitened(
        rows._replace(regressor=instruments, torques=rows.torques - (rows.regressor - instruments) @ parameters),
        parameters,
    )
    matrix = np.concatenate([white.regressor.reshape(-1, count), rows.prior[:, :-1]])
    moved = np.concatenate([shown.regressor.reshape(-1, count), rows.prior[:, :-1]])
    scale = np.linalg.norm(matrix, axis=0)
    matrix, moved = matrix / scale, moved / scale
    torques = np.append(white.torques, rows.prior[:, -1])
    return np.asarray(np.linalg.lstsq(moved.T @ matrix, moved.T @ torques)[0] / scale)
