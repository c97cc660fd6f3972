"""A rich MuJoCo model of a plant, with bodies to look at, for pictures and the viewer; the search never uses it."""

from __future__ import annotations

import os
import sys
from copy import copy

import numpy as np

from metaid.errors import RenderError, optional_packages, usable_mujoco
from metaid.models import Array, Chain
from metaid.plant import ArmPlant, MujocoPlant
from metaid.plant.description import build_arm_spec, build_spec
from metaid.show.rendering import Camera

with usable_mujoco():
    import mujoco

LINK, JOINT, MASS = (0.34, 0.71, 0.91, 1.0), (0.0, 0.45, 0.70, 1.0), (0.84, 0.37, 0.0, 1.0)  # Okabe and Ito
UNCOLOURED = (0.5, 0.5, 0.5, 1.0)  # MuJoCo's own of a shape that has none
HALF_VIEW = 22.5  # degrees, from the middle of a picture to its upper edge
PIXELS = 720  # of a picture's longest side at most


def scene(plant: MujocoPlant) -> mujoco.MjModel:
    """A chain on its stand: links as rods, joints and centres of mass as balls.

    It is the plant's own model (`build_spec`) with shapes that weigh nothing, so it moves as the `plant` does. A tilted
    base is drawn upright, and gravity tilted.
    """
    chain = plant.chain
    spec = build_spec(chain, plant.felt_gravity, plant.timestep, plant.tilt)
    spec.visual.global_.offwidth = spec.visual.global_.offheight = PIXELS
    spec.visual.headlight.ambient = spec.visual.headlight.diffuse = [0.5, 0.5, 0.5]
    reach = float(chain.length.sum())
    spec.stat.extent, spec.stat.center = 2.0 * reach, [0.0, 0.0, 0.0]
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=[1.0, 1.0, 1.0],
        width=64,
        height=384,
    )
    thick = 0.035 * reach
    shape = mujoco.mjtGeom
    spec.worldbody.add_light(pos=[0.0, -2.0 * reach, 2.0 * reach], dir=[0.0, 0.7, -0.7])
    spec.worldbody.add_geom(
        type=shape.mjGEOM_BOX,
        size=[0.12 * reach, thick, thick / 2],
        pos=[0.0, 0.0, -1.5 * thick],
        rgba=[0.3, 0.3, 0.32, 1.0],
    )
    for i in range(chain.nlink):
        body = spec.body(f"link_{i + 1}")
        rod = [0.0, 0.0, 0.0, 0.0, 0.0, chain.length[i]]
        body.add_geom(type=shape.mjGEOM_CAPSULE, fromto=rod, size=[thick / 2, 0.0, 0.0], rgba=LINK)
        body.add_geom(type=shape.mjGEOM_SPHERE, size=[0.9 * thick, 0.0, 0.0], rgba=JOINT)
        body.add_geom(type=shape.mjGEOM_SPHERE, pos=[0.0, 0.0, chain.com[i]], size=[0.7 * thick, 0.0, 0.0], rgba=MASS)
    return spec.compile()


def front_camera(chain: Chain, angles: Array) -> Camera:
    """Looks along y from where all link tips are seen at all these joint `angles` (... x njoint), in rad."""
    absolute = np.cumsum(angles, axis=-1)
    across = np.abs(np.cumsum(chain.length * np.sin(absolute), axis=-1)).max()
    reach, lowest = chain.length.sum(), min(np.cumsum(chain.length * np.cos(absolute), axis=-1).min(), 0.0)
    half = 1.1 * max(across, (reach - lowest) / 2)
    return Camera((0.0, 0.0, (reach + lowest) / 2), half / np.tan(np.radians(HALF_VIEW)), 90.0, 0.0)


def arm_scene(plant: ArmPlant) -> mujoco.MjModel:
    """What a film shows of an arm: as `in_viewer`, shapes without a colour of their own coloured by link."""
    model, links = copy(in_viewer(plant)[0]), plant.arm.whole.link_of
    model.vis.headlight.ambient[:] = model.vis.headlight.diffuse[:] = 0.5
    if model.ngeom == plant.arm.whole.model.ngeom:
        for geom in range(model.ngeom):
            link = links[model.geom_bodyid[geom]]
            if link >= 0 and model.geom_matid[geom] < 0 and (model.geom_rgba[geom] == UNCOLOURED).all():
                model.geom_rgba[geom] = (LINK, JOINT)[link % 2]
    return model


def side_camera(model: mujoco.MjModel, poses: Array) -> Camera:
    """Looks obliquely from above from where the bodies of a `model` are seen in all these `poses` (... x nq)."""
    data, places = mujoco.MjData(model), []
    for pose in poses.reshape(-1, model.nq):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        places.append(np.concatenate([data.xpos, data.xipos[1:]]))
    low, high = (end(np.concatenate(places), axis=0) for end in (np.min, np.max))
    half = 0.5 * np.linalg.norm(high - low)
    return Camera(tuple(((low + high) / 2).tolist()), half / np.tan(np.radians(HALF_VIEW)), 125.0, -15.0)


def open_viewer(plant: MujocoPlant | ArmPlant) -> None:
    """MuJoCo's viewer on the plant, until its window is closed.  Raises RenderError where there is no screen."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise RenderError(
            "there is no screen here to open a window on: try 'metaid plant draw', or 'metaid episode … --video'"
        )
    with optional_packages("view"):
        import glfw  # noqa: F401, MuJoCo's own error does not name it
        import mujoco.viewer

    model, pose = in_viewer(plant)
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.viewer.launch(model, data)


def in_viewer(plant: MujocoPlant | ArmPlant) -> tuple[mujoco.MjModel, Array]:
    """The model that the viewer moves, the plant's own, with shapes, and the coordinates (nq) at which it begins: of a
    chain upright, of an arm at home. Of that it is the whole file, where that has shapes, else rods.
    """
    if isinstance(plant, MujocoPlant):
        return scene(plant), np.zeros(plant.njoint)
    whole = plant.arm.whole
    return (whole.model, whole.pose) if whole.model.ngeom else (_rods(plant), plant.home)


def _rods(plant: ArmPlant) -> mujoco.MjModel:
    """The lean model of an arm, a rod from each joint to the next, and from the last through its centre of mass."""
    tree, spec = plant.tree, build_arm_spec(plant.tree, plant.timestep)
    ends = np.concatenate([tree.position[1:], 2.0 * tree.com[-1:]])
    thick = 0.03 * np.linalg.norm(ends, axis=1).sum()
    for i, end in enumerate(ends):
        body, size = spec.body(f"link_{i + 1}"), [thick, 0.0, 0.0]
        if np.linalg.norm(end) > thick:
            rod = [0.0, 0.0, 0.0, *end]
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=rod, size=size, rgba=LINK)
        else:
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=size, rgba=LINK)
    return spec.compile()
