"""The arm of a bench: hinges in a row, from the links of a plant file or from an MJCF."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Arm(NamedTuple):
    """n hinges, each after the one before, seen from frames that the links carry.

    Attributes:
        places: of each joint in the frame of the link before (n x 3), in m.
        turns: rotation of each link's frame against that of the one before at angle 0 (n x 3 x 3).
        axes: of the joints in their links' frames (n x 3).
        masses: of the links (n), in kg.
        coms: their centres of mass in their frames (n x 3), in m.
        inertias: about these, in the axes of their frames (n x 3 x 3), in kg m².
        rotors: reflected inertia of what turns with each joint (n), in kg m².
        tips: where a push strikes each link, in its frame (n x 3), in m.
        gravity: in the frame of the base (3), in m/s².
    """

    places: Array
    turns: Array
    axes: Array
    masses: Array
    coms: Array
    inertias: Array
    rotors: Array
    tips: Array
    gravity: Array


def arm_of_links(plant: dict[str, Any]) -> Arm:
    """A planar chain of a plant file's `links`, upright along z, whose joints turn about y."""
    links = plant["links"]
    length, mass = (np.array([float(link[key]) for link in links]) for key in ("length", "mass"))
    com = np.array([float(link.get("com", link["length"] / 2)) for link in links])
    own = np.array([float(link.get("inertia", m * a**2 / 12)) for link, m, a in zip(links, mass, length, strict=True)])
    count, up = len(links), np.array([0.0, 0.0, 1.0])
    places = np.outer(np.append(0.0, length[:-1]), up)
    return Arm(
        places,
        np.tile(np.eye(3), (count, 1, 1)),
        np.tile([0.0, 1.0, 0.0], (count, 1)),
        mass,
        np.outer(com, up),
        own[:, None, None] * np.eye(3),
        np.array([float(link.get("armature", 0.0)) for link in links]),
        np.outer(length, up),
        -float(plant.get("gravity", 9.81)) * up,
    )


def arm_of_mjcf(path: Path) -> Arm:
    """The arm of an MJCF, whose bodies have one hinge each, the first on the world."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    bodies = np.flatnonzero(model.body_jntnum == 1)
    joints = model.body_jntadr[bodies]
    return Arm(
        np.array([_joint_place(model, int(body)) for body in bodies]),
        np.array([_rotation(model.body_quat[body]) for body in bodies]),
        model.jnt_axis[joints].astype(np.float64),
        model.body_mass[bodies].astype(np.float64),
        model.body_ipos[bodies] - model.jnt_pos[joints],
        np.array([_inertia(model.body_iquat[body], model.body_inertia[body]) for body in bodies]),
        model.dof_armature[model.jnt_dofadr[joints]].astype(np.float64),
        np.zeros((len(bodies), 3)),
        model.opt.gravity.astype(np.float64),
    )


def _joint_place(model: Any, body: int) -> Array:
    """Of the joint of a `body`, in the frame of the body before, whose origin is its own joint."""
    turned = _rotation(model.body_quat[body]) @ model.jnt_pos[model.body_jntadr[body]]
    parent = model.body_parentid[body]
    before = model.jnt_pos[model.body_jntadr[parent]] if model.body_jntnum[parent] else np.zeros(3)
    return np.asarray(model.body_pos[body] + turned - before, dtype=np.float64)


def _rotation(quaternion: Array) -> Array:
    import mujoco

    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def _inertia(quaternion: Array, principal: Array) -> Array:
    rotation = _rotation(quaternion)
    return np.asarray((rotation * principal) @ rotation.T, dtype=np.float64)
