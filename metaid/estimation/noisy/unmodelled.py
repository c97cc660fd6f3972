"""A force that the model has not, looked for in what an estimate leaves of the readings.

Wrong lumps can make up for a spring or for friction so well that the misfit hardly says so. So the torque that each
such force would add is taken for one unknown more a joint. Where that lowers the sum of squares by far more than noise
would, the force is there, or something like it (Eq. 38). Where the readings cannot tell the force from a lump, the lump
is known only if there is no such force.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from metaid.estimation.estimate import Found
from metaid.estimation.faults import FORCES, UNSEEN, Unmodelled
from metaid.estimation.noisy.readings import Readings
from metaid.estimation.trials import ReadTrial
from metaid.models import DEVIATIONS, SLIDING, Array

CHANCE = 6.0  # standard deviations above what noise alone gains: it does not gain as much by chance
LEAST_GAIN = 15.0  # for the tails of so many forces and joints
SELDOM = 3.5  # standard deviations above that: noise alone gains as much once in a hundred times
TRIFLE = 1e-3  # of a lump: a force that moves none by more does no harm
RANK = 1e-12  # of the largest singular value; a smaller one is rounding
# A filter is linear about the twin that it leads, and what it leaves out looks like joints that push by a little.
RESISTING = ("damping", "coulomb")
FORCE_OF = {"viscous": "damping", "dry": "coulomb"}  # the force that a fault is, where it has another name


def unmodelled_forces(readings: Readings, estimate: Found) -> Iterator[Unmodelled]:
    """What each kind of force would be, beside unknowns that may change with it.  Eq. 38.

    Forces that are among the unknowns, as lumps or as faults, are not looked for.
    """
    known = {*readings.unknowns.kinds, *(FORCE_OF.get(kind, kind) for kind in readings.faults.kinds)}
    kinds = [kind for kind in FORCES if kind not in known]
    if not kinds:
        return
    torques = [_torques(trial, *readings.motion(number)) for number, trial in enumerate(readings.trials)]
    columns = [np.concatenate([each[kind] for kind in kinds]) for each in torques]
    residuals = readings.residuals_with(estimate.point, columns)
    if residuals is None:
        return
    lumps, count = len(estimate.names), len(readings.spreads)
    prior = np.zeros((count, residuals.slopes.shape[1]))
    prior[:, :count] = np.diag(1.0 / readings.spreads)
    slopes = np.vstack([residuals.slopes, prior])
    values = np.append(residuals.values, estimate.point[:count] / readings.spreads)
    before, _, alone = least_squares(slopes[:, :count], values)
    first = count
    for kind in kinds:
        last = first + len(torques[0][kind])
        after, step, covariance = least_squares(np.column_stack([slopes[:, :count], slopes[:, first:last]]), values)
        more = np.maximum(np.diag(covariance)[:lumps] - np.diag(alone)[:lumps], 0.0)
        resists = not (readings.is_led and kind in RESISTING and bool((step[count:] <= 0.0).all()))
        matters = resists and bool((np.abs(step[:lumps]) > DEVIATIONS * estimate.deviations + TRIFLE).any())
        yield Unmodelled(
            kind=kind,
            sizes=step[count:],
            deviations=np.sqrt(np.diag(covariance)[count:]),
            left=after / before,
            shift=step[:lumps],
            reach=UNSEEN * np.sqrt(more),
            is_seen=matters and before - after > by_chance(last - first),
            is_hinted=matters and before - after > _seldom(last - first),
        )
        first = last


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
    timestep, joints = trial.timestep * trial.substeps, np.eye(trial.start_speeds.shape[1])
    earlier = np.zeros_like(trial.torques)
    earlier[:, 1:] = trial.torques[:, :-1]
    return {
        "spring": -angles * joints[:, None, None],
        "damping": -speeds * joints[:, None, None],
        "coulomb": -np.clip(speeds / SLIDING, -1.0, 1.0) * joints[:, None, None],
        "delay": ((earlier - trial.torques) / timestep)[None],
    }
