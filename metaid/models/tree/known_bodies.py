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
from metaid.models.tree.tree import UPPER, Tree

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
    tree, beforehand, gain = possible.tree, prior.parameter_covariance, prior.gain
    left = beforehand - gain @ prior.base.matrix @ beforehand + gain @ covariance @ gain.T
    joints = np.arange(tree.njoint)
    of_links = left.reshape(tree.njoint, -1, tree.njoint, left.shape[0] // tree.njoint)[joints, :BODY, joints, :BODY]
    steps = NUDGE * np.sqrt(np.diag(beforehand)).reshape(tree.njoint, -1)
    changes = []
    for parameter in range(BODY):
        step = np.where(np.arange(steps.shape[1]) == parameter, steps, 0.0)
        more, less = (body_quantities(tree.with_parameters(tree.parameters + each)) for each in (step, -step))
        changes.append((more - less).reshape(-1, tree.njoint) / (2.0 * steps[:, parameter]))
    spread = np.einsum("pqi,ipr,rqi->qi", changes, of_links, changes).ravel()
    return KnownBodies(
        tuple(f"{kind}_{joint + 1}" for kind in QUANTITIES for joint in joints),
        tuple(unit for unit in QUANTITIES.values() for _ in joints),
        body_quantities(tree),
        np.sqrt(np.maximum(spread, 0.0)),
    )


def body_quantities(tree: Tree) -> Array:
    """The quantities of the links of an arm (n), in the order of `KnownBodies`."""
    inertia = tree.inertia[:, *UPPER]
    return np.concatenate([tree.mass, tree.com.T.ravel(), inertia.T.ravel()])
