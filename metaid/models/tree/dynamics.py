"""What moves arms at many states at once: the mass matrix, and the torque without accelerations, of the same links.

All is in the frame of the base, where a link turns and moves as the sum of the joints before it makes it, and a joint
carries the sum of the links behind it: 4 x 4 matrices, of homogeneous coordinates. Equation numbers are those of
docs/method.md.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from metaid.models.lumps import Array
from metaid.models.tree.bodies import pseudo_inertia
from metaid.models.tree.regressor import BODY
from metaid.models.tree.tree import Tree, crossing

Dynamics = Callable[[Array, Array], tuple[Array, Array]]


def arm_dynamics(tree: Tree, parameters: Array) -> Dynamics:
    """What makes of coordinates and speeds (nstate x njoint each) the mass matrix (nstate x njoint x njoint), in kg m²
    (kg m and kg where joints are slides), rotors included, and the torque (nstate x njoint) where no joint accelerates,
    in N m or N, without friction.  Eq. 52.

    Args:
        tree: where the joints are.
        parameters: of joints and links (njoint x 13, or nstate x njoint x 13), which need not be those of bodies that
            can be.
    """
    n = tree.njoint
    own = np.moveaxis(pseudo_inertia(parameters).reshape(-1, n, 4, 4), 0, -1).copy()
    parts, slides, gravity = _parts(tree), tree.slides[:, None], tree.gravity[:, None]
    rotors = parameters[..., BODY, None] * np.eye(n)
    before, behind = np.tril(np.ones((n, n))), np.triu(np.ones((n, n)))  # each joint's own among them

    def dynamics(coordinates: Array, speeds: Array) -> tuple[Array, Array]:
        frames, rates = _placed(parts, slides, coordinates.T)
        inertia = np.einsum("nijs,nkjs->niks", _product(frames, own), frames)
        moving = rates * speeds.T[:, None, None]
        motion = np.tensordot(before, moving, 1)
        changing = _product(motion, moving) - _product(moving, motion)
        faster = np.tensordot(before, changing, 1) + _product(motion, motion)
        faster[:, :3, 3] -= gravity
        bias = (rates * np.tensordot(behind, _product(faster, inertia), 1)).sum(axis=(1, 2)).T
        carried = _product(rates, np.tensordot(behind, inertia, 1))
        upper = np.triu(np.einsum("nijs,mijs->snm", rates, carried))
        return upper + np.triu(upper, 1).swapaxes(1, 2) + rotors, bias

    return dynamics


def joint_mass_matrix(tree: Tree, coordinates: Array) -> Array:
    """The mass matrix (... x njoint x njoint) of an arm at `coordinates` (... x njoint)."""
    states = coordinates.reshape(-1, tree.njoint)
    matrices, _ = arm_dynamics(tree, tree.parameters)(states, np.zeros_like(states))
    return matrices.reshape(*coordinates.shape, tree.njoint)


def _parts(tree: Tree) -> Array:
    """What the frame of each link in that of the link before is a sum of (njoint x 16 x 3): it as it is at 0; times
    sin q, or of a slide q; times 1 − cos q.
    """
    at_zero, joint = np.tile(np.eye(4), (tree.njoint, 1, 1)), np.zeros((tree.njoint, 4, 4))
    at_zero[:, :3, :3], at_zero[:, :3, 3] = tree.rotation, tree.position
    slides = tree.slides[:, None]
    joint[:, :3, :3] = np.where(slides[..., None], 0.0, crossing(tree.axis))
    joint[:, :3, 3] = np.where(slides, tree.axis, 0.0)
    return np.stack([at_zero, at_zero @ joint, at_zero @ joint @ joint], axis=-1).reshape(-1, 16, 3)


def _placed(parts: Array, slides: NDArray[np.bool_], coordinates: Array) -> tuple[Array, Array]:
    """The frames T of links in that of the base, and what a rate of each joint makes of those that it moves, (∂T/∂q)
    T⁻¹ (njoint x 4 x 4 x nstate each), at `coordinates` (njoint x nstate).
    """
    sine, cosine = np.sin(coordinates), np.cos(coordinates)
    factors = np.zeros((len(parts), 3, 2, coordinates.shape[1]))
    factors[:, 0, 0] = 1.0
    factors[:, 1] = np.stack([np.where(slides, coordinates, sine), np.where(slides, 1.0, cosine)], axis=1)
    factors[:, 2] = np.stack([1.0 - cosine, sine], axis=1)
    both = (parts @ factors.reshape(len(parts), 3, -1)).reshape(-1, 4, 4, *factors.shape[2:])
    for before, own in pairwise(both):
        own[:] = np.einsum("ijs,jkcs->ikcs", before[:, :, 0], own)
    frames, turned = both[:, :, :, 0], both[:, :, :, 1]
    rates = np.zeros(frames.shape)
    rates[:, :3, :3] = np.einsum("nijs,nkjs->niks", turned[:, :3, :3], frames[:, :3, :3])
    rates[:, :3, 3] = turned[:, :3, 3] - np.einsum("nijs,njs->nis", rates[:, :3, :3], frames[:, :3, 3])
    return frames, rates


def _product(one: Array, other: Array) -> Array:
    """Of matrices (njoint x 4 x 4 x nstate each)."""
    product: Array = np.einsum("nijs,njks->niks", one, other)
    return product
