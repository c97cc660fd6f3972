"""A URDF of a public repository as MuJoCo loads it without its meshes."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

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
    copy = place / path.name
    tree.write(copy)
    return copy


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
