"""Linear regression of commanded torques on filtered motion: ordinary, weighted by the covariance across joints, and
robust.

The equations of motion are linear in the lumps, and in friction and tilt where these are searched. Delays are searched
by shifting the torques.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.by_torque import inverse_dynamics_regressor
from benchmarks.recording import Recording, filtered
from benchmarks.rivals.logs import Log
from metaid.models import Array

SPANS = (0.2, 0.4, 0.8, 1.5)  # of the derivatives' filter, in natural times
KEPT = 8  # samples of a filter's span that are kept: the others say little more
HUBER, REWEIGHTED = 1.5, 5  # of a whitened residual; and how often
LEAST_VARIANCE = 1e-12  # of a joint, as a share of that of all: exact data leave nothing
LONGEST_DELAY = 8  # steps


@dataclass(frozen=True)
class Columns:
    """Regression `parameters` (nparameter) in the order of the columns: gravity, Coriolis and inertia lumps, then,
    where they are searched, friction of each joint, in N m s, and of each link the gravity lump times the tilt.
    """

    parameters: Array
    nlink: int
    searched: tuple[str, ...]

    @property
    def lumps(self) -> Array:
        """Gravity and Coriolis lumps (nlump)."""
        return self.parameters[: self._pairs]

    @property
    def inertia(self) -> Array:
        """Inertia lumps (nlink)."""
        return self.parameters[self._pairs : self._pairs + self.nlink]

    @property
    def friction(self) -> Array:
        """Of each joint (njoint), in N m s."""
        first = self._pairs + self.nlink
        return self.parameters[first : first + self.nlink] if "friction" in self.searched else np.zeros(self.nlink)

    @property
    def tilt(self) -> float:
        """Of the base, in rad: what explains its columns best."""
        weight = self.lumps[: self.nlink]
        return float(self.parameters[-self.nlink :] @ weight / (weight @ weight)) if "tilt" in self.searched else 0.0

    @property
    def _pairs(self) -> int:
        return self.nlink + self.nlink * (self.nlink - 1) // 2


def regressor(motion: Recording, gravity: float, searched: tuple[str, ...]) -> Array:
    """Joint torque per unit of each of `Columns` (nsample x njoint x nparameter)."""
    n = motion.angles.shape[-1]
    signals = (signal.reshape(-1, n) for signal in (motion.angles, motion.speeds, motion.accelerations))
    angles, speeds, accelerations = signals
    parts = [inverse_dynamics_regressor(angles, speeds, accelerations, gravity)]
    if "friction" in searched:
        parts.append(speeds[:, :, None] * np.eye(n))
    if "tilt" in searched:  # sin(φ + t) is sin φ + t cos φ
        force = -gravity * np.cos(np.cumsum(angles, axis=1))
        parts.append(np.where(np.arange(n)[:, None] <= np.arange(n), force[:, None, :], 0.0))
    return np.concatenate(parts, axis=2)


def motions(log: Log, angles: Array, speeds: Array, delay: int, spans: tuple[float, ...] = SPANS) -> list[Recording]:
    """The motion of a log, or one that was simulated in its place, and the torques that made it.

    Args:
        log: with the torques.
        angles: of the motion (nstep + 1 x njoint), in rad.
        speeds: of the motion (nstep + 1 x njoint), in rad/s, for where the sensors are exact: then accelerations are
            their differences.
        delay: steps by which torques are late.
        spans: of the filters, in natural times; each makes a recording.
    """
    late = delayed(log, delay)
    if log.condition.is_exact:
        step = max(len(late) // 5000, 1)
        accelerations = np.diff(speeds, axis=0) / log.timestep
        return [Recording(angles[:-1:step], speeds[:-1:step], accelerations[::step], late[::step], log.timestep * step)]
    return [
        thinned(log, filtered(angles[None, :-1], late[None], log.timestep, log.natural, span), span) for span in spans
    ]


def delayed(log: Log, delay: int) -> Array:
    """The torques of a log (nstep x njoint), in N m, late by `delay` steps."""
    torques = log.seen.torques
    return np.concatenate([np.zeros((delay, torques.shape[1])), torques[: len(torques) - delay]])


def thinned(log: Log, whole: Recording, span: float) -> Recording:
    """What is left of a filtered recording when KEPT samples of each span are kept."""
    step = max(round(span * log.natural / log.timestep / KEPT), 1)
    angles, speeds, accelerations = whole.angles[0, ::step], whole.speeds[0, ::step], whole.accelerations[0, ::step]
    return Recording(angles, speeds, accelerations, whole.torques[0, ::step], log.timestep * step)


Rows = tuple[Array, Array]  # a regressor (nsample x njoint x nparameter) and torques (nsample x njoint)


def ordinary(rows: Rows) -> Array:
    """Parameters by least squares. Columns are brought to the same length."""
    matrix, torques = rows[0].reshape(-1, rows[0].shape[2]), rows[1].ravel()
    scale = np.linalg.norm(matrix, axis=0)
    return np.asarray(np.linalg.lstsq(matrix / scale, torques)[0] / scale)


def whitened(rows: Rows, parameters: Array) -> Rows:
    """Rows in units of the covariance across joints of what `parameters` leave unexplained."""
    matrix, torques = rows
    left = torques - matrix @ parameters
    covariance = left.T @ left / len(left)
    least = LEAST_VARIANCE * np.trace(covariance) + np.finfo(float).tiny
    root = np.linalg.cholesky(covariance + least * np.eye(len(covariance)))
    white = np.linalg.solve(root, np.eye(len(root)))
    return np.asarray(white @ matrix), np.asarray(torques @ white.T)


def weighted(rows: Rows) -> Array:
    """Parameters by least squares that are weighted by the covariance of the residuals across joints."""
    return ordinary(whitened(rows, ordinary(rows)))


def robust(rows: Rows) -> Array:
    """The same, reweighted by Huber's weights."""
    parameters = weighted(rows)
    for _ in range(REWEIGHTED):
        matrix, torques = whitened(rows, parameters)
        size = np.abs(torques - matrix @ parameters)
        weight = np.sqrt(np.minimum(1.0, HUBER / np.maximum(size, 1e-12)))
        parameters = ordinary((weight[..., None] * matrix, weight * torques))
    return parameters


def searched_delay(log: Log) -> int:
    """By how many steps torques are late: 0 where that is not searched, else what leaves the least of them unexplained
    by one of the filters.
    """
    if "delay" not in log.condition.searched:
        return 0
    left = []
    for delay in range(LONGEST_DELAY + 1):
        motion = motions(log, log.seen.angles, log.seen.speeds, delay, SPANS[1:2])[0]
        rows = regressor(motion, log.gravity, log.condition.searched), motion.torques
        left.append(float(((rows[1] - rows[0] @ ordinary(rows)) ** 2).sum()))
    return int(np.argmin(left))


def regress(log: Log, solve: Callable[[Rows], Array]) -> list[Columns]:
    """What regression finds with each filter, by this way to `solve`."""
    searched, found = log.condition.searched, []
    for motion in motions(log, log.seen.angles, log.seen.speeds, searched_delay(log)):
        rows = regressor(motion, log.gravity, searched), motion.torques
        found.append(Columns(solve(rows), log.nominal.nlink, searched))
    return found
