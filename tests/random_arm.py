"""Arms of no one's, whose frames, axes and links are as general as can be."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.random import Generator

from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant import ArmPlant, load_plant


def random_arm(njoint: int, seed: int, slides: tuple[int, ...] = (), friction: bool = True) -> Tree:
    """An arm with random frames, axes, links, rotors and, unless it is without `friction`, viscous and dry friction.

    Args:
        njoint: the number of joints.
        seed: of all that is random.
        slides: which joints are slides.
        friction: whether it has some.
    """
    random = np.random.default_rng(seed)
    axes = random.standard_normal((njoint, 3))
    sticks = random.standard_normal((njoint, 8, 3))  # a link is eight points, so a body that can be
    mass = random.uniform(0.5, 3.0, njoint)
    rubbed = random.uniform(0.1, 0.5, (2, njoint)) * friction
    return Tree(
        names=tuple(f"joint_{i + 1}" for i in range(njoint)),
        position=random.uniform(-0.3, 0.3, (njoint, 3)),
        rotation=np.array([_rotation(random) for _ in range(njoint)]),
        axis=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        slides=np.isin(np.arange(njoint), slides),
        low=np.full(njoint, -2.5),
        high=np.full(njoint, 2.5),
        torque_limit=np.full(njoint, np.inf),
        gravity=np.array([0.5, -1.0, -9.7]),
        mass=mass,
        com=random.uniform(-0.2, 0.2, (njoint, 3)),
        inertia=np.array([_inertia(each, points) for each, points in zip(mass, sticks, strict=True)]),
        rotor=random.uniform(0.05, 0.3, njoint),
        damping=rubbed[0],
        coulomb=rubbed[1],
    )


def wrong_tree(tree: Tree, seed: int) -> Tree:
    """An arm that another is believed to be: links wrong by up to 30 %, rotors and friction unknown."""
    random, n = np.random.default_rng(seed), tree.njoint
    return replace(
        tree,
        mass=tree.mass * random.uniform(0.7, 1.3, n),
        com=tree.com * random.uniform(0.85, 1.15, (n, 3)),
        inertia=tree.inertia * random.uniform(0.7, 1.3, (n, 1, 1)),
        rotor=np.zeros(n),
        damping=np.zeros(n),
        coulomb=np.zeros(n),
    )


def _rotation(random: Generator) -> Array:
    matrix, _ = np.linalg.qr(random.standard_normal((3, 3)))
    return np.asarray(matrix * np.sign(np.linalg.det(matrix)), dtype=np.float64)


def _inertia(mass: float, points: Array) -> Array:
    second = 0.01 * mass * (points.T @ points) / len(points)
    return np.asarray(np.trace(second) * np.eye(3) - second, dtype=np.float64)


SOME = ("one", "four", "pa10", "puma560")  # arms by name: one joint, four with a slide, and two that are shipped


@cache
def arm_named(name: str) -> Tree:
    """One of SOME, or a shipped arm."""
    if name in SOME[:2]:
        return random_arm(1, 1) if name == "one" else random_arm(4, 3, slides=(2,))
    plant = load_plant(name)
    assert isinstance(plant, ArmPlant)
    return plant.tree
