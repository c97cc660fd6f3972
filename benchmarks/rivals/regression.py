"""Linear regression of commanded torques on filtered motion: ordinary, weighted by the covariance across joints, and
robust.

The equations of motion are linear in a model's parameters. Delays are searched by shifting the torques, and offsets of
encoders step by step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from benchmarks.recording import FILTER_ORDER, filtered
from benchmarks.rivals.logs import Log
from benchmarks.rivals.models import ChainModel, Motion
from metaid.models import Array
from metaid.models.law import sliding

SPANS = (0.2, 0.4, 0.8, 1.5)  # of the derivatives' filter, in natural times
KEPT = 8  # samples of a filter's span that are kept: the others say little more
HUBER, REWEIGHTED = 1.5, 5  # of a whitened residual; and how often
LEAST_VARIANCE = 1e-12  # of a joint, as a share of that of all: exact data leave nothing
LONGEST_DELAY = 8  # steps
OFFSET_STEPS = 5  # each of which leaves some hundredths of an offset


@dataclass(frozen=True)
class Beforehand:
    """What a log is freed from before anything is regressed: torques that are late by `delay` steps, and by how much
    each angle is read too large (njoint), in rad.
    """

    delay: int
    offset: Array


def motions(
    log: Log, angles: Array, speeds: Array, known: Beforehand, spans: tuple[float, ...] = SPANS
) -> list[Motion]:
    """The motion of a log, or one that was simulated in its place, and the torques that made it.

    Args:
        log: with the torques.
        angles: as they were read (nstep + 1 x njoint), in rad.
        speeds: of the motion (nstep + 1 x njoint), in rad/s, for where the sensors are exact: then accelerations are
            their differences, of the middle of each step.
        known: what it is freed from.
        spans: of the filters, in natural times; each makes a recording.
    """
    late, angles = delayed(log, known.delay), angles - known.offset
    if log.condition.is_exact:
        step = max(len(late) // 5000, 1)
        accelerations = (np.diff(speeds, axis=0) / log.timestep)[::step]
        middle, turning = ((0.5 * (each[1:] + each[:-1]))[::step] for each in (angles, speeds))
        return [Motion(middle, turning, accelerations, late[::step], log.timestep * step, sliding(turning))]
    return [_thinned(log, angles, late, span) for span in spans]


def _thinned(log: Log, angles: Array, torques: Array, span: float) -> Motion:
    """What is left of a filtered recording when KEPT samples of each span are kept. A torque is held for a timestep: at
    the end of one half of it is that of before.
    """
    acting = 0.5 * (torques + np.concatenate([torques[:1], torques[:-1]]))
    whole = filtered(angles[None, :-1], acting[None], log.timestep, log.natural, span)
    window = max(round(span * log.natural / log.timestep), FILTER_ORDER + 2) | 1
    sides = savgol_filter(sliding(whole.speeds[0]), window, FILTER_ORDER, axis=0)
    step = max(round(span * log.natural / log.timestep / KEPT), 1)
    angles, speeds, accelerations = whole.angles[0, ::step], whole.speeds[0, ::step], whole.accelerations[0, ::step]
    return Motion(angles, speeds, accelerations, whole.torques[0, ::step], log.timestep * step, sides[::step])


def delayed(log: Log, delay: int) -> Array:
    """The torques of a log (nstep x njoint), in N m, late by `delay` steps."""
    torques = log.seen.torques
    return np.concatenate([np.zeros((delay, torques.shape[1])), torques[: len(torques) - delay]])


class Rows(NamedTuple):
    """What a motion says: a `regressor` (nsample x njoint x nparameter) and `torques` (nsample x njoint); and what was
    believed before, the `prior` (nparameter x nparameter + 1): parameters times its first columns are its last, with
    errors of standard deviation 1. Of a chain nothing is.
    """

    regressor: Array
    torques: Array
    prior: Array


def solved(rows: Rows) -> Array:
    """Parameters by least squares of these rows and the prior. Columns are brought to the same length."""
    matrix = np.concatenate([rows.regressor.reshape(-1, rows.regressor.shape[2]), rows.prior[:, :-1]])
    scale = np.linalg.norm(matrix, axis=0)
    return np.asarray(np.linalg.lstsq(matrix / scale, np.append(rows.torques, rows.prior[:, -1]))[0] / scale)


def ordinary(rows: Rows) -> Array:
    """Parameters by least squares that believe nothing, for they do not know how large errors are."""
    return solved(rows._replace(prior=rows.prior[:0]))


def whitened(rows: Rows, parameters: Array) -> Rows:
    """Rows in units of the covariance across joints of what `parameters` leave unexplained."""
    left = rows.torques - rows.regressor @ parameters
    covariance = left.T @ left / len(left)
    least = LEAST_VARIANCE * np.trace(covariance) + np.finfo(float).tiny
    root = np.linalg.cholesky(covariance + least * np.eye(len(covariance)))
    white = np.linalg.solve(root, np.eye(len(root)))
    return Rows(np.asarray(white @ rows.regressor), np.asarray(rows.torques @ white.T), rows.prior)


def weighted(rows: Rows) -> Array:
    """Parameters by least squares that are weighted by the covariance of the residuals across joints."""
    return solved(whitened(rows, ordinary(rows)))


def robust(rows: Rows) -> Array:
    """The same, reweighted by Huber's weights."""
    parameters = weighted(rows)
    for _ in range(REWEIGHTED):
        white = whitened(rows, parameters)
        size = np.abs(white.torques - white.regressor @ parameters)
        weight = np.sqrt(np.minimum(1.0, HUBER / np.maximum(size, 1e-12)))
        parameters = solved(Rows(weight[..., None] * white.regressor, weight * white.torques, rows.prior))
    return parameters


def rows_of(log: Log, motion: Motion) -> Rows:
    """What a motion says of the parameters, without what a model leaves out."""
    kept = log.model.kept(motion)
    return Rows(log.model.regressor(motion) * kept[:, :, None], motion.torques * kept, log.model.prior)


def search_beforehand(log: Log) -> Beforehand:
    """Delay and offsets: none where they are not searched, else what leaves the least torque unexplained by one of the
    filters.
    """
    known, searched = Beforehand(0, np.zeros(log.model.njoint)), log.condition.searched

    def seen(known: Beforehand) -> Motion:
        return motions(log, log.seen.angles, log.seen.speeds, known, SPANS[2:3])[0]

    if "delay" in searched:
        tried = [Beforehand(delay, known.offset) for delay in range(LONGEST_DELAY + 1)]
        left = []
        for each in tried:
            rows = rows_of(log, seen(each))
            left.append(float(((rows.torques - rows.regressor @ ordinary(rows)) ** 2).sum()))
        known = tried[int(np.argmin(left))]
    if "offset" in searched:
        assert isinstance(log.model, ChainModel)
        for _ in range(OFFSET_STEPS):
            motion = seen(known)
            further = np.concatenate([log.model.regressor(motion), log.model.turned(motion.angles)], axis=2)
            found = weighted(Rows(further, motion.torques, np.empty((0, further.shape[2] + 1))))
            turned = -found[-log.model.njoint :] / found[: log.model.njoint]  # of each link, in rad
            known = Beforehand(known.delay, known.offset + np.diff(turned, prepend=0.0))
    return known


def regress(log: Log, solve: Callable[[Rows], Array]) -> list[Array]:
    """The parameters that regression finds with each filter, by this way to `solve`."""
    seen = motions(log, log.seen.angles, log.seen.speeds, search_beforehand(log))
    return [solve(rows_of(log, motion)) for motion in seen]
