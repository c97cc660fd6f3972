"""A nominal arm that is drawn at random about another, with the errors of the prior."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from metaid.models import Array
from metaid.models.tree import PriorDeviations, Tree


def drawn_nominal(tree: Tree, seed: int, prior: PriorDeviations) -> Tree:
    """An arm like `tree`, with the same joints.

    The masses and the moments of inertia about the centre of mass are wrong by up to the deviations of the `prior`, and
    so are the centres of mass, as a share of their distance from the joint. Each error is drawn evenly to both sides,
    with that `seed`. Nothing is known of friction and of rotors: they are 0.
    """
    random = np.random.Generator(np.random.SFC64([seed]))
    n, nothing = tree.njoint, np.zeros(tree.njoint)
    mass = tree.mass * (1.0 + prior.mass * random.uniform(-1.0, 1.0, n))
    lever = np.linalg.norm(tree.com, axis=1, keepdims=True)
    com = tree.com + prior.com * lever * random.uniform(-1.0, 1.0, (n, 3))
    inertia = _stretched(tree.inertia, 1.0 + prior.inertia * random.uniform(-1.0, 1.0, n))
    return replace(tree, mass=mass, com=com, inertia=inertia, rotor=nothing, damping=nothing, coulomb=nothing)


def _stretched(inertia: Array, factors: Array) -> Array:
    """The `inertia` of links (njoint x 3 x 3) times `factors` (njoint)."""
    return np.asarray(inertia * factors[:, None, None], dtype=np.float64)
