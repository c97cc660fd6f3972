"""A URDF of a public repository as MuJoCo loads it without its meshes."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from metaid.models import Array


def bare_urdf(path: Path, place: Path) -> Path:
    """A copy in a `place` that has no meshes, which are elsewhere, and links of no inertia with a little."""
    tree = ElementTree.parse(path)
    for link in tree.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
        for inertia in link.iter("inertia"):
            if not any(float(value) for value in inertia.attrib.values()):
                inertia.attrib |= {"ixx": "0.0001", "iyy": "0.0001", "izz": "0.0001"}
    place.mkdir(exist_ok=True)
    copy = place / path.name
    tree.write(copy)
    return copy


def balanced_urdf(path: Path, place: Path) -> Path:
    """A copy without meshes, whose moments of inertia MuJoCo makes those of a body where no body has them."""
    copy = bare_urdf(path, place / "balanced")
    tree = ElementTree.parse(copy)
    own = ElementTree.SubElement(tree.getroot(), "mujoco")
    ElementTree.SubElement(own, "compiler", balanceinertia="true")
    tree.write(copy)
    return copy


def urdf_of(
    name: str,
    twists: Sequence[float],
    along: Sequence[float],
    offsets: Sequence[float],
    bodies: Array,
    place: Path,
    turned: Sequence[float] = (),
) -> Path:
    """A URDF, in a `place`, of hinges `joint1`, `joint2`, ... in modified Denavit-Hartenberg frames.

    Args:
        name: of the robot, and of the file.
        twists: of each joint's axis against that before, about its x, in rad.
        along: from that before, along its x, in m.
        offsets: along the joint's own axis, in m.
        bodies: of each link its mass in kg, first moment in kg m, and xx, xy, xz, yy, yz, zz in kg m² about the origin
            of its frame (nlink x 10).
        place: where it is written.
        turned: by which each frame is turned about the joint's own axis where its angle is 0, in rad; not at all.
    """
    turned = turned or [0.0] * len(twists)
    parts, before = (
        [f'<robot name="{name}"><mujoco><compiler balanceinertia="true"/></mujoco><link name="base"/>'],
        "base",
    )
    for joint, (mass, *rest) in enumerate(bodies.tolist()):
        com = np.array(rest[:3]) / mass
        xx, xy, xz, yy, yz, zz = rest[3:]
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - mass * (
            com @ com * np.eye(3) - np.outer(com, com)
        )
        moments = " ".join(f'i{"xyz"[i]}{"xyz"[j]}="{about[i, j]:.9g}"' for i in range(3) for j in range(i, 3))
        sine, cosine = np.sin(twists[joint]), np.cos(twists[joint])
        parts.append(
            f'<link name="link{joint + 1}"><inertial><origin xyz="{com[0]:.9g} {com[1]:.9g} {com[2]:.9g}"/>'
            f'<mass value="{mass}"/><inertia {moments}/></inertial></link>'
            f'<joint name="joint{joint + 1}" type="continuous"><parent link="{before}"/><child link="link{joint + 1}"/>'
            f'<origin xyz="{along[joint]} {-sine * offsets[joint]:.9g} {cosine * offsets[joint]:.9g}" '
            f'rpy="{_roll_pitch_yaw(twists[joint], turned[joint])}"/><axis xyz="0 0 1"/></joint>'
        )
        before = f"link{joint + 1}"
    path = place / f"{name}.urdf"
    path.write_text("".join(parts) + "</robot>", encoding="utf-8")
    return path


def _roll_pitch_yaw(twist: float, turn: float) -> str:
    """Of a frame that is turned by a `twist` about x, and then by a `turn` about its own z, in rad."""
    with warnings.catch_warnings(action="ignore"):  # where roll and yaw are about one axis
        angles = Rotation.from_euler("XZ", [twist, turn]).as_euler("xyz")
    return " ".join(f"{angle:.12g}" for angle in angles)


def with_bodies(model: Any, parameters: Array) -> Any:
    """A model (mujoco.MjModel) whose moving bodies have other inertial parameters (nbody x 10): moments and products of
    inertia xx, xy, xz, yy, yz, zz about the frame of the body, in kg m², first moments, in kg m, and mass, in kg.
    """
    for body, (xx, xy, xz, yy, yz, zz, *first, mass) in enumerate(parameters.tolist(), 1):
        com = np.array(first) / mass
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        about -= mass * (com @ com * np.eye(3) - np.outer(com, com))
        moments, axes = np.linalg.eigh(about)
        axes[:, 0] *= np.sign(np.linalg.det(axes))
        mujoco.mju_mat2Quat(model.body_iquat[body], axes.ravel())
        model.body_mass[body], model.body_ipos[body], model.body_inertia[body] = mass, com, moments
        model.body_sameframe[body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model
