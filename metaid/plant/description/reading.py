"""From an arm's plant file to a `Tree`: MuJoCo compiles the user's whole file, then what moves is taken from it."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from metaid.errors import PlantError
from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant.arm_settings import ArmSettings, by_joint
from metaid.plant.description.compiling import compile_file, gathered_warnings
from metaid.plant.description.fusing import Whole, fuse, joint_name
from metaid.plant.description.refusing import moving_joints, refuse_what_is_no_arm
from metaid.plant.lean import arm_model, mujoco

LIGHTEST = 1e-6  # kg, of a last link
TOLERANCE = 1e-8  # relative: the lean model must move as the whole file does


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm as its plant file says it is: its `tree`, the `whole` file it was made from, the coordinates `home` of its
    joints (njoint), in rad or m, the `stiffness` of their springs, in N m/rad or N/m, and where these are `slack`
    (njoint each), pairs of joints with whose sum a motor turns (`couples`), and what was repaired in its moving links.
    """

    tree: Tree
    whole: Whole
    home: Array
    stiffness: Array
    slack: Array
    couples: tuple[tuple[int, int], ...] = ()
    repairs: tuple[str, ...] = ()


def read_arm(settings: ArmSettings, source: str) -> Arm:
    """The arm of a plant file, `source` in messages, by its `settings`, with the `mjcf` or `urdf` as found from here.

    Raises PlantError where that is missing, does not compile, or is no serial arm.
    """
    path = Path(settings.file)
    compiled = compile_file(path, is_urdf=settings.kind == "urdf")
    model, named = compiled.model, f"{source}: {path.name}"
    joints = moving_joints(named, model, settings.joints)
    whole = Whole(model, joints, _pose(model, settings, source), compiled.lost)
    texts = [each.text for each in compiled.repairs if each.matters(whole.names)]
    if settings.joints is None and whole.held:
        texts.append(f"held, for they are on branches: {', '.join(whole.held)} (--joints A,B of those that move)")
    repairs = tuple(f"{path.name}: {text}" for text in texts)
    refuse_what_is_no_arm(named, whole)
    tree = fuse(whole)
    if tree.mass[-1] <= LIGHTEST:
        raise PlantError(
            f"{named}: nothing that joint '{tree.names[-1]}' moves weighs anything (allowed: a link with an <inertial>)"
        )
    refuse_another_motion(named, whole, tree, settings.timestep)

    def instead(key: str, values: Array) -> Array:
        return by_joint(f"{source}: {key}", getattr(settings, key), tree.names, values)

    settled = replace(
        tree,
        gravity=tree.gravity if settings.gravity is None else np.array(settings.gravity),
        rotor=instead("rotor", tree.rotor),
        damping=instead("damping", tree.damping),
        coulomb=instead("frictionloss", tree.coulomb),
        torque_limit=instead("torque_limit", tree.torque_limit),
    )
    stiffness, slack = map(instead, ("stiffness", "slack"), whole.springs)
    return Arm(settled, whole, whole.pose[whole.addresses], stiffness, slack, tuple(whole.couples.values()), repairs)


def _pose(model: mujoco.MjModel, settings: ArmSettings, source: str) -> Array:
    """Coordinates of all joints of the model (nq): those of `home`, else those of the file's keyframe of that name,
    else those of its reference pose, within their ranges.
    """
    kinds = model.jnt_type
    single = np.flatnonzero((kinds == mujoco.mjtJoint.mjJNT_HINGE) | (kinds == mujoco.mjtJoint.mjJNT_SLIDE))
    names = [joint_name(model, joint) for joint in single.tolist()]
    keys = [key for key in range(model.nkey) if model.key(key).name == "home"]
    pose: Array = model.key_qpos[keys[0]].copy() if keys else model.qpos0.copy()
    limited, addresses = model.jnt_limited[single, None] > 0, model.jnt_qposadr[single]
    low, high = np.where(limited, model.jnt_range[single], [-np.inf, np.inf]).T
    pose[addresses] = home = by_joint(f"{source}: home", settings.home, names, np.clip(pose[addresses], low, high))
    for name, given, least, most in zip(names, home, low, high, strict=True):
        if not least <= given <= most:
            raise PlantError(f"{source}: home: {name}: {given:g} is beyond its range (allowed: {least:g} to {most:g})")
    return pose


def refuse_another_motion(source: str, whole: Whole, tree: Tree, timestep: float) -> None:
    """Compares the lean model with the whole file in random states.

    What is known to move an arm otherwise has been refused by name. This finds what was not thought of.

    Args:
        source: the file, for the message of an error.
        whole: the file, compiled, and the joints that move.
        tree: made of it.
        timestep: in s.

    Raises:
        PlantError: they do not move alike.
    """
    with gathered_warnings() as warned:
        try:
            lean = arm_model(tree, timestep, *whole.springs)
        except (ValueError, mujoco.FatalError) as problem:
            raise PlantError(f"{source}: MuJoCo cannot build its joints and links alone: {problem}") from None
        _compare(source, whole, tree, lean)
    if warned:
        raise PlantError(f"{source}: MuJoCo cannot compute its motion: {warned[0]}")


def _compare(source: str, whole: Whole, tree: Tree, lean: mujoco.MjModel) -> None:
    random = np.random.default_rng(0)
    low, high = np.maximum(tree.low, -np.pi), np.minimum(tree.high, np.pi)
    for _ in range(3):
        coordinates, speeds = random.uniform(low, np.maximum(low, high)), random.uniform(-1.0, 1.0, tree.njoint)
        of_lean, of_whole = forces_of_lean(lean, coordinates, speeds), forces_of_whole(whole, coordinates, speeds)
        inertia = np.abs(of_whole[0]).max()
        for what, mine, theirs in zip(("inertia", "weight", "passive force"), of_lean, of_whole, strict=True):
            difference = np.abs(mine - theirs).reshape(tree.njoint, -1).max(axis=1)
            if not difference.max() <= TOLERANCE * max(np.abs(theirs).max(), inertia):
                raise PlantError(
                    f"{source}: joint '{tree.names[int(difference.argmax())]}' feels more {what} than that of its "
                    f"links (allowed: weight, inertia, rotors, springs and friction alone)"
                )


def forces_of_lean(model: mujoco.MjModel, coordinates: Array, speeds: Array) -> tuple[Array, Array, Array]:
    """Mass matrix (njoint x njoint), bias force and passive force (njoint each) of a lean model in a state."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = coordinates, speeds
    return _forces(model, data, list(range(model.nv)))


def forces_of_whole(whole: Whole, coordinates: Array, speeds: Array) -> tuple[Array, Array, Array]:
    """The same of the whole file, of the joints that move while the others are held, without motors that turn with two
    of them.
    """
    model, couples = copy(whole.model), list(whole.couples)
    model.tendon_armature[couples] = model.tendon_damping[couples] = 0.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT  # what touches in such a pose does not matter
    data = mujoco.MjData(model)
    data.qpos[:] = whole.at(coordinates)
    data.qvel[whole.degrees] = speeds
    return _forces(model, data, whole.degrees)


def _forces(model: mujoco.MjModel, data: mujoco.MjData, degrees: list[int]) -> tuple[Array, Array, Array]:
    mujoco.mj_forward(model, data)
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    return matrix[np.ix_(degrees, degrees)], data.qfrc_bias[degrees], data.qfrc_passive[degrees]
