"""How well a log of a motion will show each parameter: the motion is recorded of the nominal robot, and estimated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.excitation.search import MotionSearch
from metaid.excitation.series import Series
from metaid.models import COARSEST, Array
from metaid.recorded import Choices, LogRun, equations_like, estimate_records

LASTS = 0.1  # s: how long a torque that no model explains lasts
REHEARSED = 48  # logs, whose noise differs
THREADS = 2  # of rehearsals: BLAS and compiled loops run side by side
SHARED = 16  # logs that the errors of all parameters together count for, beside those of each
FRICTION = ("viscous", "coulomb")
Torques = Callable[[Array, Array, Array], Array]  # of angles, speeds and accelerations (nrow x njoint each)


@dataclass(frozen=True)
class LogNoise:
    """Of a log: of an `angle` reading, a standard deviation in rad or m; of `torque`, as a share of each joint's root
    mean square, what no model explains, which lasts for LASTS; `period` between readings, in s.
    """

    angle: float = 1e-4
    torque: float = 0.03
    period: float = 0.002


@dataclass(frozen=True)
class LogForecast:
    """What a log of a motion will say, were the nominal robot the truth.

    Attributes:
        deviations: standard deviations that an estimate of the unknowns will have (nparam), friction included.
        determined: which of them (nparam) are known to a tenth, as `LinearModel.determined` has it.
        unknown: the joints whose torque will be predicted to no better than a tenth.
    """

    deviations: Array
    determined: NDArray[np.bool_]
    unknown: tuple[str, ...]


def recorded(torques: Torques, series: Series, seconds: float, noise: LogNoise, seeds: Sequence[int]) -> list[LogRun]:
    """Logs of a robot that follows a series exactly, again and again.

    Args:
        torques: that the robot needs.
        series: the motion.
        seconds: of a log.
        noise: of it.
        seeds: of the noise of each.
    """
    times = np.asarray(noise.period * np.arange(round(seconds / noise.period)), dtype=np.float64)
    angles = series.at(times).angles
    held = series.at(times + 0.5 * noise.period)  # a torque holds until the next
    sent = torques(*held)
    size = noise.torque * np.sqrt((sent**2).mean(axis=0))
    keeps = float(np.exp(-noise.period / LASTS))
    drawn = np.array([np.random.default_rng(seed).standard_normal((2, *sent.shape)) for seed in seeds])
    unexplained = drawn[:, 0]
    for row in range(1, len(times)):
        unexplained[:, row] = keeps * unexplained[:, row - 1] + np.sqrt(1.0 - keeps**2) * unexplained[:, row]
    return [
        LogRun("motion", times, angles + noise.angle * of_angles, None, sent + size * of_torques)
        for of_torques, of_angles in zip(unexplained, drawn[:, 1], strict=True)
    ]


def forecast(problem: MotionSearch, series: Series, seconds: float, noise: LogNoise) -> LogForecast:
    """What a log of a motion will say.

    Args:
        problem: what the motion was found for.
        series: the motion.
        seconds: of the log.
        noise: of it.
    """
    model, nominal = problem.model, problem.nominal
    logs = recorded(problem.torques, series, seconds, noise, range(REHEARSED))
    found = estimate_records(logs[:1], model, Choices(friction=FRICTION, zeros=False, delay=0.0))

    def rehearse(record: LogRun) -> tuple[Array, Array, Array]:
        equations = equations_like(found, record)
        solution = equations.solution
        inverse = np.linalg.inv(solution.precision)
        of_prior = np.diag(inverse @ solution.prior @ inverse)
        return np.diag(equations.covariance(solution.values)), of_prior, solution.values - nominal

    with ThreadPoolExecutor(THREADS) as pool:
        variances, beforehand, errors = zip(*pool.map(rehearse, logs), strict=True)
    prior = np.mean(beforehand, axis=0)  # which errors do not show where the nominal robot is the truth
    usual = np.mean(variances, axis=0) - prior
    growth = np.mean(np.square(errors) / usual, axis=0)  # by errors that last longer than a covariance counts
    growth = (REHEARSED * growth + SHARED * growth.mean()) / (REHEARSED + SHARED)
    deviations = np.sqrt(growth * usual + prior)
    unknown = _unknown(problem, series, found.covariance)
    return LogForecast(deviations, model.determined(nominal, deviations), unknown)


def _unknown(problem: MotionSearch, series: Series, covariance: Array) -> tuple[str, ...]:
    """The joints whose torque is predicted to no better than a tenth along the motion."""
    rows = problem.model.regressor(*series.at(np.linspace(0.0, series.period, 200)))
    variance = np.einsum("tjp,pq,tjq->tj", rows, covariance, rows, optimize=True).mean(axis=0)
    sizes = np.sqrt(((rows @ problem.nominal) ** 2).mean(axis=0))
    wide = np.sqrt(variance) > COARSEST * sizes
    return tuple(name for name, is_wide in zip(problem.model.joints, wide.tolist(), strict=True) if is_wide)
