"""The shapes of an arm's whole file as triangles, for pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models import Array
from metaid.plant.description.fusing import Whole
from metaid.plant.lean import mujoco

AROUND, ALONG = 20, 9  # triangles of a round shape
MOST = 1500  # triangles of a mesh; of a finer one every other is left out, or more


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface of one shape: its corners (n x 3 x 3) in the base's frame, in m, and the `link` it is part of, from
    0; −1 for the base and what stands around it.
    """

    triangles: Array
    link: int


def surfaces(whole: Whole, coordinates: Array) -> list[Surface]:
    """The surfaces of all shapes of the file at joint `coordinates` (njoint). Floors and terrains are left out."""
    model, data, links = whole.model, whole.posed(coordinates), whole.link_of
    found = []
    for geom in range(model.ngeom):
        corners = _triangles(model, geom)
        if corners is not None:
            turned = corners @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            found.append(Surface(turned, links[model.geom_bodyid[geom]]))
    return found


def rod(start: Array, end: Array, radius: float, link: int) -> Surface:
    """A capsule between two points.

    Args:
        start: the one (3), in the base's frame, in m.
        end: the other (3).
        radius: in m.
        link: that it is part of.
    """
    along = end - start
    length = float(np.linalg.norm(along))
    quaternion, rotation = np.empty(4), np.empty(9)
    mujoco.mju_quatZ2Vec(quaternion, along / length if length else np.array([0.0, 0.0, 1.0]))
    mujoco.mju_quat2Mat(rotation, quaternion)
    return Surface(_round(radius, length / 2) @ rotation.reshape(3, 3).T + (start + end) / 2, link)


def _triangles(model: mujoco.MjModel, geom: int) -> Array | None:
    """Of a shape in its own frame (n x 3 x 3); None of one without end, or that nothing here draws."""
    kinds, kind = mujoco.mjtGeom, int(model.geom_type[geom])
    size: Array = model.geom_size[geom]
    if kind == kinds.mjGEOM_SPHERE:
        return _round(size[0], 0.0)
    if kind == kinds.mjGEOM_CAPSULE:
        return _round(size[0], size[1])
    if kind == kinds.mjGEOM_ELLIPSOID:
        return _round(1.0, 0.0) * size
    if kind == kinds.mjGEOM_CYLINDER:
        return _turned(np.array([[0.0, -size[1]], [size[0], -size[1]], [size[0], size[1]], [0.0, size[1]]]))
    if kind == kinds.mjGEOM_BOX:
        flat = _turned(np.array([[0.0, -1.0], [np.sqrt(2.0), -1.0], [np.sqrt(2.0), 1.0], [0.0, 1.0]]), 4)
        return flat * size
    if kind == kinds.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        faces = model.mesh_face[first : first + count : 1 + count // MOST]
        corners: Array = model.mesh_vert[model.mesh_vertadr[mesh] + faces].astype(np.float64)
        return corners
    return None


def _round(radius: float, half: float) -> Array:
    """A capsule of half a length `half` along z."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, 2 * (ALONG // 2) + 2)
    profile = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    profile[:, 1] += np.where(angles < 0, -half, half)
    return _turned(profile)


def _turned(profile: Array, around: int = AROUND) -> Array:
    """The surface (n x 3 x 3) of a `profile` of radii and heights (m x 2) turned about z."""
    angles = 2.0 * np.pi * (np.arange(around + 1) + 0.5) / around
    circle = np.stack([np.cos(angles), np.sin(angles), np.ones(around + 1)], axis=1)
    points = circle[:, None, :] * profile[:, [0, 0, 1]]  # (around + 1) x m x 3
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)
