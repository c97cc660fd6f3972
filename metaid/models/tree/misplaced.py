"""An arm of which a joint is not where it is said to be."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from metaid.models.lumps import Array
from metaid.models.tree.tree import UPPER, Tree, crossing, inertia_matrices

MISPLACED, TURNED = 0.005, 0.01  # m, rad: how far a joint may be from where it is said to be, a standard deviation


def misplaced(tree: Tree, step: float) -> Iterator[tuple[int, Tree, float]]:
    """Each joint, the arm with that joint beside its place or turned by a `step`, in m or rad, along or about one of
    three axes, and how much of that there may be, a standard deviation.
    """
    for joint in range(tree.njoint):
        for axis in range(3):
            place = tree.position.copy()
            place[joint, axis] += step
            yield joint, replace(tree, position=place), MISPLACED
            rotation = tree.rotation.copy()
            rotation[joint] = rotation[joint] @ (np.eye(3) + step * crossing(np.eye(3)[axis]))
            yield joint, replace(tree, rotation=rotation), TURNED


def last_link_turned(tree: Tree, parameters: Array) -> Array:
    """How parameters (njoint x 13) change per rad that the last link is turned about the axis of its joint. A slide
    turns nothing.
    """
    changes = np.zeros_like(parameters)
    if not tree.slides[-1]:
        across = crossing(tree.axis[-1])
        inertia = across @ inertia_matrices(parameters[-1])
        changes[-1, 1:4] = across @ parameters[-1, 1:4]
        changes[-1, 4:10] = (inertia + inertia.T)[UPPER]
    return changes
