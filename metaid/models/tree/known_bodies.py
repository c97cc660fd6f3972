"""What is known of the links of an arm of which base parameters are known: masses, centres of mass, inertias.

Base parameters leave much of them open. What is left open is as the prior has it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models.lumps import Array
from metaid.models.tree.arm_prior import ArmPrior
from metaid.models.tree.bodies import possible_bodies
from metaid.models.tree.regressor import BODY
from metaid.models.tree.tree import Tree

QUANTITIES = {"mass": "kg", "com_x": "m", "com_y": "m", "com_z": "m"}
QUANTITIES |= {f"inertia_{axes}": "kg m²" for axes in ("xx", "xy", "xz", "yy", "yz", "zz")}
NUDGE = 1e-5  # of a parameter's deviation, by which quantities are differentiated


@dataclass(frozen=True, eq=False)
class KnownBodies:
    """The links of an arm. Centres of mass are in the frame of the link, moments of inertia about the centre of mass.

    Attributes:
        names: of their quantities (n), those of each kind together.
        units: of them (n).
        values: of the possible bodies that are closest to the nominal arm's (n).
        deviations: standard deviations (n), to first order.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    deviations: Array


def known_bodies(prior: ArmPrior, values: Array, covariance: Array) -> KnownBodies | None:
    """The links of an arm with base parameters `values` (nbase), known with this `covariance` (nbase x nbase); None
    where no possible bodies have these.
    """
    possible = possible_bodies(prior, values)
    if possible is None:
        return None
    njoint, beforehand, gain = prior.nominal.njoint, prior.parameter_covariance, prior.gain
    left = beforehand - gain @ prior.base.matrix @ beforehand + gain @ covariance @ gain.T
    blocks = left.reshape(njoint, -1, njoint, left.shape[0] // njoint)
    steps = NUDGE * np.sqrt(np.diag(beforehand)).reshape(njoint, -1)[:, :BODY]
    parameters, deviations = possible.tree.parameters[:, :BODY], []
    for i, (own, step) in enumerate(zip(parameters, np.diag(np.ones(BODY)) * steps[:, None], strict=True)):
        change = (_quantities(own + step) - _quantities(own - step)) / (2.0 * np.diag(step)[:, None])
        spread = np.einsum("pq,pr,rq->q", change, blocks[i, :BODY, i, :BODY], change)
        deviations.append(np.sqrt(np.maximum(spread, 0.0)))
    kinds, joints = list(QUANTITIES), range(1, njoint + 1)
    return KnownBodies(
        tuple(f"{kind}_{joint}" for kind in kinds for joint in joints),
        tuple(QUANTITIES[kind] for kind in kinds for _ in joints),
        body_quantities(possible.tree),
        np.array(deviations).T.ravel(),
    )


def body_quantities(tree: Tree) -> Array:
    """The quantities of the links of an arm (n), in the order of `KnownBodies`."""
    return _quantities(tree.parameters[:, :BODY]).T.ravel()


def _quantities(parameters: Array) -> Array:
    """Mass, centre of mass and inertia about that (... x 10) of links by their `parameters` (... x 10)."""
    mass, com = parameters[..., :1], parameters[..., 1:4] / parameters[..., :1]
    lever = (com**2).sum(axis=-1)[..., None, None] * np.eye(3) - com[..., :, None] * com[..., None, :]
    square = mass[..., None] * lever
    upper = np.triu_indices(3)
    return np.concatenate([mass, com, parameters[..., 4:] - square[..., *upper]], axis=-1)
