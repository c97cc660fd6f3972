"""The estimate where torques are noisy, and how large their noise is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from metaid.compiled import share_out
from metaid.estimation.estimate import Found
from metaid.estimation.fit import begun, fit
from metaid.estimation.noisy.innovations import Innovations
from metaid.models import Array

MOST_ROUNDS = 6  # of gains and unknowns in turn
SETTLED = 0.05  # standard deviations, by which unknowns change in the last round
APART, FARTHEST = 0.05, 1.5  # in the logarithm of a size: for its derivatives, and the longest step
MOST_SWEEPS, CLOSE = 8, 0.02  # of the search for the sizes, and the step that ends it
ALIKE = 1.0  # standard deviation of the logarithm of the acceleration that a joint's noise is, about their mean
ROUGH_PUSHES, PUSHES = 12, 48  # whose readings tell the sizes: in the first round, and after it
ROOM = 30_000_000  # numbers that linearised steps of pushes take, at most
FLAT = 0.5  # of the logarithm of the likelihood by that of a size: noise so small that it tells nothing

HALVES = slice(0, None, 2), slice(1, None, 2)  # of pushes, which threads share

Likelihood = Callable[[Array, slice], Array]  # its logarithm (ncase), by the sizes (ncase x njoint), of which pushes


def fit_with_torque_noise(
    innovations: Innovations,
    start: Array | None,
    torque_noise: Array,
    rounds: int = MOST_ROUNDS,
    begins_anew: bool = False,
) -> Found | None:
    """The robot that all trials lead to where noise of the torques moves it, too, and the size of that noise; None
    where the twin cannot follow the trials.

    Gains and weights of the filter follow from the robot, and the robot from what the filter leaves. So they are found
    in turn, until the readings become no more likely: where joints stick, smaller gains may lose a push. In each round
    gains are given, so its estimate is one of least squares.

    Args:
        innovations: of all trials, without gains.
        start: unknowns of the robot, with faults behind them (nunknown), to begin with; None for where fits to such
            a robot begin.
        torque_noise: what the noise of each joint's torque is thought to be (njoint), in N m.
        rounds: at most.
        begins_anew: whether pushes begin in each round as they were to, which may lead out of a wrong minimum; by
            default they begin as they did in the end of the round before.
    """
    count, begin, sizes = len(innovations.spreads), begun(innovations, start), torque_noise
    best: Found | None = None
    point, most_likely = np.append(np.zeros(count) if begin is None else begin, np.zeros(innovations.extras)), -np.inf
    for _ in range(rounds):
        if best is None:
            sizes = likeliest_noise(innovations, point, sizes, ROUGH_PUSHES)
        sizes = likeliest_noise(innovations, point, sizes, PUSHES, 1)
        led = innovations.led(point, sizes)
        fitted = None if led is None else fit(led, point[:count] if begins_anew else point, -1)
        if fitted is None:
            return None
        before, found = best, replace(fitted, torque_noise=sizes)
        point = found.point
        likelihood = innovations.likelihood(point, sizes, PUSHES)
        if best is None or likelihood > most_likely:
            best, most_likely = found, likelihood
        if before is not None and (best is before or _is_settled(before, found)):
            break
    assert best is not None, "there is a round"
    return best


def _is_settled(before: Found, after: Found) -> bool:
    """Whether the last round has changed no unknown."""
    return bool((np.abs(after.unknowns - before.unknowns) <= SETTLED * after.deviations).all())


def likeliest_noise(
    innovations: Innovations, point: Array, torque_noise: Array, pushes: int, sweeps: int = MOST_SWEEPS
) -> Array:
    """The standard deviation of the noise of each joint's torque (njoint), in N m, that makes the readings most likely:
    by Newton's steps in the logarithms.  Eq. 37.

    Args:
        innovations: of all trials.
        point: the unknowns of all pushes, and behind them those of each.
        torque_noise: where the search begins (njoint), in N m.
        pushes: how many are looked at, at most.
        sweeps: over all joints. Where there are several, there are as many of steps that all joints have in common
            before.
    """
    joints, logarithms = np.eye(len(torque_noise)), np.log(torque_noise)
    needed = np.log(innovations.unknowns.inertia)
    numbers = max(trial.torques.shape[1] for trial in innovations.trials) * 6 * len(torque_noise) ** 2
    looked_at = max(min(pushes, ROOM // numbers), 1)
    filters = innovations.filters(point, looked_at)
    multiplications = looked_at * numbers * len(torque_noise)
    for directions in (np.ones_like(joints[:1]), joints) if sweeps > 1 else (joints,):
        for _ in range(sweeps):
            before = logarithms
            parts = [each.likelihood_about(np.exp(logarithms)) for each in filters]
            for direction in directions:
                logarithms = logarithms + _step(parts, logarithms, direction, needed, multiplications) * direction
            if float(np.abs(logarithms - before).max()) < CLOSE:
                break
    return np.exp(logarithms)


def _step(parts: list[Likelihood], logarithms: Array, direction: Array, needed: Array, multiplications: int) -> float:
    """The step to the top of a parabola.

    Args:
        parts: what the readings say.
        logarithms: of the sizes (njoint).
        direction: in which they change (njoint).
        needed: logarithms of what each joint needs for an acceleration (njoint).
        multiplications: that all `parts` need for one of the three points, roughly.
    """
    tried = logarithms + np.array([-APART, 0.0, APART])[:, None] * direction
    told = np.empty((len(parts), len(HALVES), len(tried)))

    def run(numbers: Iterator[int]) -> None:
        for number in numbers:
            part, half = divmod(number, len(HALVES))
            told[part, half] = parts[part](np.exp(tried), HALVES[half])

    share_out(run, len(parts) * len(HALVES), len(tried) * multiplications)
    less, here, more = told.sum(axis=(0, 1)) + np.array([_log_prior(each - needed) for each in tried])
    slope, curvature = (more - less) / (2.0 * APART), (more - 2.0 * here + less) / APART**2
    if not np.isfinite(slope + curvature) or (slope < 0.0 and slope > -FLAT):
        return 0.0
    if curvature >= 0.0:
        return float(np.sign(slope)) * FARTHEST
    return float(np.clip(-slope / curvature, -FARTHEST, FARTHEST))


def _log_prior(logarithms: Array) -> float:
    """The logarithm of how likely `logarithms` (njoint) of accelerations are beforehand: drives suit their joints."""
    return -0.5 * float(((logarithms - logarithms.mean()) ** 2).sum()) / ALIKE**2
