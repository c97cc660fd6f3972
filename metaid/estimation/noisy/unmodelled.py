"""What a model has not, a force or the true geometry, looked for in what an estimate leaves of the readings.

Wrong lumps can make up for a spring, for friction or for a joint that is elsewhere so well that the misfit hardly says
so. So the torque that each such force would add is taken for one unknown more a joint, and where each joint is for six.
Where that lowers the sum of squares by far more than noise would, it is there, or something like it (Eq. 38). What the
readings do not tell from a lump makes the lump less certain than they say.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.estimate import Found
from metaid.estimation.faults import GEOMETRY, Unmodelled
from metaid.estimation.noisy.innovations import Innovations, compared_at
from metaid.estimation.noisy.readings import Readings
from metaid.estimation.trials import ReadTrial
from metaid.models import DEVIATIONS, FRICTION, SLIDING, Array

CHANCE = 6.0  # standard deviations above what noise alone gains: it does not gain as much by chance
LEAST_GAIN = 15.0  # for the tails of so many forces and joints
SELDOM = 3.5  # standard deviations above that: noise alone gains as much once in a hundred times
TRIFLE = 1e-3  # of a lump: a force that moves none by more does no harm
RANK = 1e-12  # of the largest singular value; a smaller one is rounding
STICTION = "stiction"
NEAR_REST = 0.1  # rad/s or m/s: faster joints have none
SHIFT = 1e-5  # m or rad, for the derivative by where a joint is
FAULT_OF = {"damping": "viscous", "coulomb": "dry"}  # the fault that a force is, where it has another name


def unmodelled_forces(readings: Readings, estimate: Found) -> Iterator[Unmodelled]:
    """What each kind of force would be, and how joints would lie, beside unknowns that may change with it.  Eq. 38.

    What is among the unknowns, as lumps or as faults, is not looked for.
    """
    compared = compared_at(readings, estimate)
    if compared is None:
        return
    readings = compared
    torques = [_torques(trial, *readings.motion(number)) for number, trial in enumerate(readings.trials)]
    hidden = {kind: _not_searched(kind, len(each), readings) for kind, each in torques[0].items()}
    joints = {kind: np.arange(len(each)) for kind, each in hidden.items() if each.any()}
    columns = [
        np.concatenate(
            [np.empty((0, *each.torques.shape)), *(own[kind] * hidden[kind][:, None, None, None] for kind in joints)]
        )
        for each, own in zip(readings.trials, torques, strict=True)
    ]
    places = list(readings.unknowns.misplaced(estimate.unknowns, SHIFT))
    if places:
        joints[GEOMETRY] = np.array([joint for joint, _, _ in places])
    if not joints:
        return
    residuals = readings.residuals_with(estimate.point, columns, [moved for _, moved, _ in places])
    if residuals is None:
        return
    lumps, count = len(estimate.names), len(readings.spreads)
    spreads = np.append(readings.spreads, np.full(len(columns[0]), np.inf))
    spreads = np.append(spreads, [deviation / SHIFT for _, _, deviation in places])
    slopes = np.vstack([residuals.slopes, np.diag(1.0 / spreads)])
    values = np.concatenate(
        [residuals.values, estimate.point[:count] / readings.spreads, np.zeros(len(spreads) - count)]
    )
    before, _, _ = least_squares(slopes[:, :count], values)
    first = count
    for kind, own in joints.items():
        last = first + len(own)
        after, step, covariance = least_squares(np.column_stack([slopes[:, :count], slopes[:, first:last]]), values)
        deviations = np.sqrt(np.diag(covariance)[count:])
        # A filter is linear about the twin that it leads: what that leaves out looks like joints that push a little.
        resists = not (isinstance(readings, Innovations) and kind in FRICTION and bool((step[count:] <= 0.0).all()))
        matters = resists and bool((np.abs(step[:lumps]) > DEVIATIONS * estimate.deviations + TRIFLE).any())
        yield Unmodelled(
            kind=kind,
            sizes=step[count:] if kind != GEOMETRY else _far(own, step[count:] / spreads[first:last]),
            deviations=deviations if kind != GEOMETRY else _far(own, deviations / spreads[first:last]),
            left=after / before,
            shift=step[:lumps],
            left_open=_left_open(covariance, lumps, count),
            is_seen=matters and before - after > by_chance(last - first),
            is_hinted=matters and before - after > _seldom(last - first),
        )
        first = last


def _not_searched(kind: str, count: int, readings: Readings) -> NDArray[np.bool_]:
    """Which of so many sizes of a kind of force (count) are not among the unknowns, or were left out of them. Stiction
    is what dry friction has more at rest, where that is among them and builds up.
    """
    faults, fault = readings.faults, FAULT_OF.get(kind, kind)
    if kind == STICTION:
        rubs = readings.unknowns.builds_up or "dry" in faults.kinds
        return np.full(count, rubs and readings.trials[0].is_continuous)
    if kind in readings.unknowns.kinds:
        return np.zeros(count, dtype=np.bool_)
    return faults.is_left_out[faults.are(fault)] if fault in faults.kinds else np.ones(count, dtype=np.bool_)


def _far(joints: NDArray[np.int64], steps: Array) -> Array:
    """How far each joint is from its place (njoint), in deviations, by those of its `joints` along each way (nway)."""
    return np.sqrt(np.bincount(joints, steps**2))


def _left_open(covariance: Array, lumps: int, count: int) -> Array:
    """By how much the first `lumps` unknowns would change with each of independent sizes of a force (lumps x nsize), by
    the `covariance` of `count` unknowns and these sizes: A Aᵀ is what they add to that of the unknowns.
    """
    variances, axes = np.linalg.eigh(covariance[count:, count:])
    kept = variances > RANK * variances[-1]
    return np.asarray(covariance[:lumps, count:] @ axes[:, kept] / np.sqrt(variances[kept]))


def by_chance(count: int) -> float:
    """By how much so many unknowns more may lower the sum of squares where nothing but noise is left."""
    return count + CHANCE * float(np.sqrt(2.0 * count)) + LEAST_GAIN


def _seldom(count: int) -> float:
    """By how much so many unknowns more seldom lower it there."""
    return count + SELDOM * float(np.sqrt(2.0 * count))


def least_squares(slopes: Array, values: Array) -> tuple[float, Array, Array]:
    """The least sum of squares of values + slopes @ step, the step there, and the covariance of its parts."""
    left, singular, right = np.linalg.svd(slopes, full_matrices=False)
    kept = singular > RANK * singular[0]
    inverse = right[kept].T / singular[kept]
    step: Array = -inverse @ (left[:, kept].T @ values)
    remaining = values + slopes @ step
    return float(remaining @ remaining), step, inverse @ inverse.T


def _torques(trial: ReadTrial, angles: Array, speeds: Array) -> dict[str, Array]:
    """The joint torques that forces of one unit would add to those commanded, where joints have such `angles`, in rad,
    and `speeds`, in rad/s, at each step (npush x nstep x njoint): by kind (nsize x npush x nstep x njoint), in N m.
    """
    joints = np.eye(trial.start_speeds.shape[1])
    sides = np.clip(speeds / SLIDING, -1.0, 1.0)
    earlier = np.zeros_like(trial.torques)
    earlier[:, 1:] = trial.torques[:, :-1]
    return {
        "spring": -angles * joints[:, None, None],
        "damping": -speeds * joints[:, None, None],
        "coulomb": -sides * joints[:, None, None],
        STICTION: -sides * np.exp(-((speeds / NEAR_REST) ** 2)) * joints[:, None, None],
        "delay": ((earlier - trial.torques) / trial.period)[None],
    }
