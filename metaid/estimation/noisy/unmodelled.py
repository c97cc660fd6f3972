"""A force that the model has not, looked for in what an estimate leaves of the readings.

Wrong lumps can make up for a spring or for friction so well that the misfit hardly says so. So the torque that each
such force would add is taken for one unknown more a joint. Where that lowers the sum of squares by far more than noise
would, the force is there, or something like it (Eq. 47). Where the readings cannot tell the force from a lump, the lump
is known only if there is no such force.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from metaid.estimation.estimate import Estimate
from metaid.estimation.noisy.read_trial import ReadTrial
from metaid.estimation.noisy.readings import Readings
from metaid.models import DEVIATIONS, SLIDING, Array

CHANCE = 6.0  # standard deviations above what noise alone gains: it does not gain as much by chance
LEAST_GAIN = 15.0  # for the tails of so many forces and joints
SELDOM = 3.5  # standard deviations above that: noise alone gains as much once in a hundred times
TRIFLE = 1e-3  # of a lump: a force that moves none by more does no harm
UNSEEN = 3.0  # standard deviations of a force that readings may hide
RANK = 1e-12  # of the largest singular value; a smaller one is rounding
# What each is, its unit, and what to do about it.
KINDS = {
    "spring": (
        "a spring",
        "N m/rad",
        'no law of metaid has one: take it off, or search it: estimate.faults = ["spring"]',
    ),
    "damping": ("viscous friction", "N m s", 'search it: estimate.faults = ["viscous"]'),
    "coulomb": ("dry friction", "N m", 'search it: estimate.faults = ["dry"]'),
    "delay": ("torques that come late", "s", 'search it: estimate.faults = ["delay"]'),
}
# A filter is linear about the twin that it leads, and what it leaves out looks like joints that push by a little.
RESISTING = ("damping", "coulomb")
FORCE_OF = {"viscous": "damping", "dry": "coulomb"}  # the force that a fault is, where it has another name


@dataclass(frozen=True)
class Unmodelled:
    """A force that the model has not.

    Attributes:
        kind: "spring", "damping", "coulomb" or "delay".
        sizes: of each joint (njoint), or of all (1), in the unit of its kind.
        deviations: standard deviations of these.
        left: what share of the sum of the squared residuals it leaves.
        shift: by how much log factors (nunknown) would change.
        reach: by how much they could (nunknown), with a force so small that the readings do not show it.
        is_seen: whether it is there: it lowers the squares by more than noise would, and moves a lump out of its 95 %
            interval, and that by more than TRIFLE.
        is_hinted: whether it may be there: the same where noise would seldom lower the squares so far.
    """

    kind: str
    sizes: Array
    deviations: Array
    left: float
    shift: Array
    reach: Array
    is_seen: bool
    is_hinted: bool

    @property
    def description(self) -> str:
        """What it is, and where it is largest: `a spring in joint 1, 0.5 N m/rad`."""
        name, unit, _ = KINDS[self.kind]
        largest = int(np.argmax(np.abs(self.sizes)))
        where = f" in joint {largest + 1}" if len(self.sizes) > 1 else ""
        return f"{name}{where}, {self.sizes[largest]:.2g} {unit}"

    @property
    def name(self) -> str:
        """What it is."""
        return KINDS[self.kind][0]

    @property
    def unseen(self) -> str:
        """How much of it readings may hide: `up to 0.5 N m/rad of it`."""
        return f"up to {UNSEEN * float(self.deviations.max()):.2g} {KINDS[self.kind][1]} of it"

    @property
    def advice(self) -> str:
        """What to do about it."""
        return KINDS[self.kind][2]


def unmodelled_forces(readings: Readings, estimate: Estimate) -> Iterator[Unmodelled]:
    """What each kind of force would be, beside unknowns that may change with it.  Eq. 47.

    Forces that are among the unknowns, as lumps or as faults, are not looked for.
    """
    torques = [_torques(trial, *readings.motion(number)) for number, trial in enumerate(readings.trials)]
    known = {*readings.unknowns.kinds, *(FORCE_OF.get(kind, kind) for kind in readings.faults.kinds)}
    kinds = [kind for kind in KINDS if kind not in known]
    columns = [np.concatenate([each[kind] for kind in kinds]) for each in torques]
    residuals = readings.residuals_with(estimate.point, columns)
    if residuals is None:
        return
    lumps, count = len(estimate.names), len(readings.spreads)
    prior = np.zeros((count, residuals.slopes.shape[1]))
    prior[:, :count] = np.diag(1.0 / readings.spreads)
    slopes = np.vstack([residuals.slopes, prior])
    values = np.append(residuals.values, estimate.point[:count] / readings.spreads)
    before, _, alone = _least(slopes[:, :count], values)
    first = count
    for kind in kinds:
        last = first + len(torques[0][kind])
        after, step, covariance = _least(np.column_stack([slopes[:, :count], slopes[:, first:last]]), values)
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


def _least(slopes: Array, values: Array) -> tuple[float, Array, Array]:
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
