"""How wrong an identified chain or arm is, on states that nothing was identified from."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.by_torque import inverse_dynamics_regressor
from metaid.models import Array, Chain
from metaid.models.tree import ArmPrior, Tree, difference

STATES, ANGLE, SPEED = 500, 1.5, 1.0  # held out; of each joint, in rad, and in rad per natural time


@dataclass(frozen=True)
class Found:
    """What a method found: of a chain gravity, Coriolis and inertia lumps (nlump + nlink), of an arm base parameters
    (nbase); and what its experiment took: the `seconds` of motion, the largest joint `torque` in N m and the largest
    `range` of any joint's angle in rad; and what the method itself said of its result, where it says anything.
    """

    parameters: Array
    seconds: float
    torque: float
    range: float
    verdict: str = ""


@dataclass(frozen=True)
class Error:
    """Root mean square errors over the held-out states as shares of what is right: of `gravity` torque, `coriolis`
    torque and `mass_matrix`; and the relative error of the worst of all lumps, or that of the worst base parameter as
    a share of what was not known of it.
    """

    gravity: float
    coriolis: float
    mass_matrix: float
    worst_lump: float

    @property
    def largest(self) -> float:
        """Of the first three."""
        return max(self.gravity, self.coriolis, self.mass_matrix)


NOTHING_FOUND = Error(np.inf, np.inf, np.inf, np.inf)


def judge_chain(parameters: Array, true: Chain, gravity: float, natural: float) -> Error:
    """How wrong lumps (nlump + nlink) are. `gravity` in m/s²; the `natural` time in s scales the speeds."""
    n, random = true.nlink, np.random.default_rng(2)
    angles = random.uniform(-ANGLE, ANGLE, (STATES, n))
    speeds = random.normal(scale=SPEED / natural, size=(STATES, n))
    rest = np.zeros_like(angles)
    right = np.append(true.lumps.vector, true.inertia_lumps)
    wrong = parameters[: len(right)]
    if not np.isfinite(wrong).all():
        return NOTHING_FOUND
    weight = inverse_dynamics_regressor(angles, rest, rest, gravity)
    turning = inverse_dynamics_regressor(angles, speeds, rest, gravity) - weight
    columns = [inverse_dynamics_regressor(angles, rest, rest + unit, gravity) - weight for unit in np.eye(n)]
    gravity_share, coriolis_share, matrix_share = (
        _share(each @ right, each @ wrong) for each in (weight, turning, np.stack(columns))
    )
    return Error(gravity_share, coriolis_share, matrix_share, float(np.abs(wrong / right - 1.0).max()))


def judge_arm(parameters: Array, true: Tree, prior: ArmPrior) -> Error:
    """How wrong base parameters (nbase) are where the joints are as it is believed."""
    if not np.isfinite(parameters).all():
        return NOTHING_FOUND
    off = np.abs(parameters - prior.base.of(true.parameters)) / np.sqrt(np.diag(prior.covariance))
    return Error(**asdict(difference(true, prior.tree_at(parameters))), worst_lump=float(off.max()))


def _share(right: Array, wrong: Array) -> float:
    return float(np.sqrt(((wrong - right) ** 2).sum() / (right**2).sum()))
