"""A planar chain as a serial arm, hinges about y, one above the other; and the chain that an arm is, where it is one.

In the parameters of such an arm, with link i along z: μ_i is the base parameter m_i z + l_i Σ_{k>i} m_k (Eq. 1), d_i is
yy_i + l_i² Σ_{k>i} m_k (Eq. 3), and a_ij is l_i μ_j (Eq. 2).
"""

from __future__ import annotations

import numpy as np

from metaid.models.chain import Chain
from metaid.models.lumps import Array
from metaid.models.tree.tree import Tree

ALIKE = 1e-9  # relative: what rounding leaves of a frame that an MJCF was read into
ROUGHLY = 1e-3  # rad: as frames of a drawing are


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


def is_pendulum(tree: Tree, far: float = ROUGHLY) -> bool:
    """Whether all joints are hinges about parallel horizontal axes, to so `far` in rad, and gravity acts."""
    axes, weight = _axes(tree), float(np.linalg.norm(tree.gravity))
    is_level = weight > 0.0 and abs(float(axes[0] @ tree.gravity)) <= far * weight
    return is_level and not tree.slides.any() and bool(np.abs(np.cross(axes, axes[0])).max() <= far)


def turning(tree: Tree) -> Array:
    """By which each joint turns its link against what carries the first of the hinges with parallel axes, one behind
    the other, of which it is the last: a sum of their coordinates (njoint x njoint), −1 where an axis is turned about.
    """
    axes, found = _axes(tree), np.eye(tree.njoint)
    for joint in range(1, tree.njoint):
        same = float(axes[joint] @ axes[joint - 1])
        if abs(same) > 1.0 - ROUGHLY**2 and not tree.slides[[joint - 1, joint]].any():
            found[joint, :joint] = np.sign(same) * found[joint - 1, :joint]
    return found


def _axes(tree: Tree) -> Array:
    """Those of the joints (njoint x 3) in the frame of the base, where all joints are at 0."""
    turned, axes = np.eye(3), np.zeros((tree.njoint, 3))
    for i, (rotation, axis) in enumerate(zip(tree.rotation, tree.axis, strict=True)):
        turned = turned @ rotation
        axes[i] = turned @ axis
    return axes


def planar_chain(tree: Tree) -> Chain | None:
    """The chain whose lumps an arm has; None where it is no planar chain. Where its joints are 0 does not matter.

    All joints are hinges about parallel horizontal axes, without rotors, and each centre of mass is on the line from
    its joint to the next. The length of the last link is in no lump: it is taken to end at its centre of mass.
    """
    axes = _axes(tree)
    if not is_pendulum(tree, ALIKE) or tree.rotor.any() or (axes @ axes[0] < 0.0).any():
        return None
    across = np.eye(3) - tree.axis[:, :, None] * tree.axis[:, None, :]  # out of the plane nothing shows
    com = np.einsum("nij,nj->ni", across, tree.com)
    ahead = np.einsum("nij,nj->ni", across, np.concatenate([tree.position[1:], com[-1:]]))
    length, lever = np.linalg.norm(ahead, axis=1), np.linalg.norm(com, axis=1)
    if not (length > 0.0).all() or np.abs(com - ahead * (lever / length)[:, None]).max() > ALIKE * length.max():
        return None
    return Chain(
        length=length,
        mass=tree.mass,
        com=lever,
        inertia=np.einsum("ni,nij,nj->n", tree.axis, tree.inertia, tree.axis),
        damping=tree.damping,
        coulomb=tree.coulomb,
        stiffness=np.zeros(tree.njoint),
    )
