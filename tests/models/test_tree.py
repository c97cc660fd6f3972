"""An arm's inertial parameters."""

from __future__ import annotations

import numpy as np

from metaid.models.tree import Tree


def random_tree(njoint: int, seed: int) -> Tree:
    """An arm of random frames, axes and bodies."""
    random = np.random.default_rng(seed)
    turns = np.linalg.qr(random.standard_normal((njoint, 3, 3)))[0]
    turns *= np.sign(np.linalg.det(turns))[:, None, None]
    axis = random.standard_normal((njoint, 3))
    spread = random.uniform(0.1, 1.0, (njoint, 3))
    inertia = np.einsum("nij,nj,nkj->nik", turns, spread.sum(axis=1, keepdims=True) - spread, turns)
    return Tree(
        names=tuple(f"joint_{i + 1}" for i in range(njoint)),
        position=random.uniform(-0.5, 0.5, (njoint, 3)),
        rotation=turns,
        axis=axis / np.linalg.norm(axis, axis=1, keepdims=True),
        slides=np.zeros(njoint, dtype=np.bool_),
        low=np.full(njoint, -2.0),
        high=np.full(njoint, 2.0),
        torque_limit=np.full(njoint, np.inf),
        gravity=np.array([0.0, 0.0, -9.81]),
        mass=random.uniform(0.5, 5.0, njoint),
        com=random.uniform(-0.2, 0.2, (njoint, 3)),
        inertia=inertia,
        rotor=random.uniform(0.0, 0.1, njoint),
        damping=random.uniform(0.0, 0.1, njoint),
        coulomb=np.zeros(njoint),
    )


def test_parameters_of_an_arm_give_the_arm_back() -> None:
    """Masses, first moments and moments of inertia about the joint hold all that a body is."""
    tree = random_tree(4, 0)
    again = tree.with_parameters(tree.parameters)
    for name in ("mass", "com", "inertia", "rotor", "damping", "coulomb"):
        assert np.allclose(getattr(again, name), getattr(tree, name), rtol=0, atol=1e-14)
    assert np.allclose(again.parameters, tree.parameters, rtol=0, atol=1e-14)
