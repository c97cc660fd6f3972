"""A planar chain as a serial arm: hinges about y, one above the other."""

from __future__ import annotations

import numpy as np

from metaid.models.chain import Chain
from metaid.models.tree.tree import Tree


def planar_tree(chain: Chain, gravity: float) -> Tree:
    """The arm that a chain is, upright at q = 0, with z up; `gravity` in m/s². It has no springs."""
    n = chain.nlink
    above = np.concatenate([[0.0], chain.length[:-1]])
    upright = np.array([0.0, 0.0, 1.0])
    return Tree(
        names=tuple(f"joint_{i + 1}" for i in range(n)),
        position=above[:, None] * upright,
        rotation=np.broadcast_to(np.eye(3), (n, 3, 3)),
        axis=np.broadcast_to([0.0, 1.0, 0.0], (n, 3)),
        slides=np.zeros(n, dtype=np.bool_),
        low=np.full(n, -np.inf),
        high=np.full(n, np.inf),
        torque_limit=np.full(n, np.inf),
        gravity=-gravity * upright,
        mass=chain.mass,
        com=chain.com[:, None] * upright,
        inertia=chain.inertia[:, None, None] * np.eye(3),
        rotor=np.zeros(n),
        damping=chain.damping,
        coulomb=chain.coulomb,
    )
