"""From a compiled file to a `Tree`: what hangs on one moving joint is one body, and frames lie on the joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant.lean import mujoco

# Where a body has two joints, MuJoCo joins them by nothing. A link must weigh something: it gets this share of the
# body, which changes the motion by less than is compared anywhere.
SHARE = 1e-10


@dataclass(frozen=True, eq=False)
class Whole:
    """The user's whole file, compiled, and the joints of it that move.

    Attributes:
        model: of the whole file.
        joints: numbers of the joints that move (njoint), from the base on.
        pose: coordinates of all joints of the model (nq), with which the others are held.
        lost_meshes: that could not be loaded, so that their shapes are not there.
    """

    model: mujoco.MjModel
    joints: list[int]
    pose: Array
    lost_meshes: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(joint_name(self.model, joint) for joint in self.joints)

    @property
    def held(self) -> tuple[str, ...]:
        """The names of the joints that do not move."""
        return tuple(joint_name(self.model, joint) for joint in range(self.model.njnt) if joint not in self.joints)

    @cached_property
    def addresses(self) -> list[int]:
        """Where the coordinates of the moving joints are in the model's (njoint)."""
        return [int(self.model.jnt_qposadr[joint]) for joint in self.joints]

    @cached_property
    def degrees(self) -> list[int]:
        """Where the speeds of the moving joints are in the model's (njoint)."""
        return [int(self.model.jnt_dofadr[joint]) for joint in self.joints]

    @property
    def link_of(self) -> list[int]:
        """The link (nbody) that each body of the model is part of, −1 for the base."""
        last = {int(self.model.jnt_bodyid[joint]): i for i, joint in enumerate(self.joints)}
        links: list[int] = []
        for body, parent in enumerate(self.model.body_parentid):
            links.append(last.get(body, links[parent] if body else -1))
        return links

    @property
    def springs(self) -> tuple[Array, Array]:
        """The stiffness of the moving joints' springs, in N m/rad or N/m, and where they are slack (njoint each)."""
        off = self.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_SPRING
        stiffness = np.zeros(len(self.joints)) if off else self.model.jnt_stiffness[self.joints]
        return stiffness, np.where(stiffness, self.model.qpos_spring[self.addresses], 0.0)

    @cached_property
    def couples(self) -> dict[int, tuple[int, int]]:
        """Fixed tendons that turn with the sum of two moving joints, one right after the other, by their numbers, and
        the two, from 0 on: they stand for a motor, as in files that metaid writes.
        """
        model, found = self.model, {}
        for tendon in range(model.ntendon):
            wraps = slice(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
            joints = [self.joints.index(each) for each in model.wrap_objid[wraps] if each in self.joints]
            is_fixed = (model.wrap_type[wraps] == mujoco.mjtWrap.mjWRAP_JOINT).all()
            is_sum = len(joints) == 2 and joints[1] == joints[0] + 1 and np.ptp(model.wrap_prm[wraps]) == 0.0
            others = (model.tendon_stiffness, model.tendon_stiffnesspoly, model.tendon_dampingpoly)
            if is_fixed and is_sum and not any(each[tendon].any() for each in others):
                found[tendon] = joints[0], joints[1]
        return found

    def joints_at(self, coordinates: Array) -> tuple[Array, Array]:
        """Where the moving joints are at these `coordinates` (njoint), and their axes (njoint x 3 each), in the base's
        frame.
        """
        data = self.posed(coordinates)
        return data.xanchor[self.joints].copy(), data.xaxis[self.joints].copy()

    def tip_at(self, coordinates: Array) -> Array:
        """Where the last link ends (3): as far beyond its centre of mass as that is from its joint."""
        data = self.posed(coordinates)
        bodies = np.flatnonzero(np.array(self.link_of) == len(self.joints) - 1)
        weights = self.model.body_mass[bodies]
        centre = weights @ data.xipos[bodies] / weights.sum()
        tip: Array = 2.0 * centre - data.xanchor[self.joints[-1]]
        return tip

    def posed(self, coordinates: Array) -> mujoco.MjData:
        """Where everything is when the joints that move have these `coordinates` (njoint)."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = self.at(coordinates)
        mujoco.mj_kinematics(self.model, data)
        return data

    def at(self, coordinates: Array) -> Array:
        """Coordinates of all joints of the model (nq) where those that move have these `coordinates` (njoint)."""
        pose = self.pose.copy()
        pose[self.addresses] = coordinates
        return pose


def body_name(model: mujoco.MjModel, body: int) -> str:
    """The name of a body; where it has none, its number."""
    return model.body(body).name or f"body_{body}"


def joint_name(model: mujoco.MjModel, joint: int) -> str:
    """The name of a joint; where it has none, its number."""
    return model.joint(joint).name or f"joint_{joint + 1}"


def fuse(whole: Whole) -> Tree:
    """The serial arm that moves as the whole file does while the other joints are held."""
    model, njoint = whole.model, len(whole.joints)
    data = whole.posed(np.zeros(njoint))
    origin = data.xanchor[whole.joints]
    frames = data.xmat[model.jnt_bodyid[whole.joints]].reshape(-1, 3, 3)
    before_origin = np.concatenate([np.zeros((1, 3)), origin[:-1]])
    before_frames = np.concatenate([np.eye(3)[None], frames[:-1]])
    mass, com, inertia = _links(whole, data, origin, frames)
    degrees, limited = whole.degrees, model.jnt_limited[whole.joints].astype(bool)
    off, disabled = mujoco.mjtDisableBit, model.opt.disableflags
    low, high = model.jnt_range[whole.joints].T
    armature, damping = _actuators_share(whole)
    return Tree(
        names=whole.names,
        position=np.einsum("nji,nj->ni", before_frames, origin - before_origin),
        rotation=before_frames.transpose(0, 2, 1) @ frames,
        axis=np.einsum("nji,nj->ni", frames, data.xaxis[whole.joints]),
        slides=model.jnt_type[whole.joints] == mujoco.mjtJoint.mjJNT_SLIDE,
        low=np.where(limited, low, -np.inf),
        high=np.where(limited, high, np.inf),
        torque_limit=_torque_limits(whole),
        gravity=np.zeros(3) if disabled & off.mjDSBL_GRAVITY else model.opt.gravity.copy(),
        mass=mass,
        com=com,
        inertia=inertia,
        rotor=model.dof_armature[degrees] + armature,
        damping=np.zeros(njoint) if disabled & off.mjDSBL_DAMPER else model.dof_damping[degrees] + damping,
        coulomb=np.zeros(njoint) if disabled & off.mjDSBL_FRICTIONLOSS else model.dof_frictionloss[degrees].copy(),
    )


def _links(whole: Whole, data: mujoco.MjData, origin: Array, frames: Array) -> tuple[Array, Array, Array]:
    """Mass (njoint), centre of mass (njoint x 3) and inertia about it (njoint x 3 x 3) of each link, in its frame."""
    model, njoint = whole.model, len(whole.joints)
    mass, com, inertia = np.zeros(njoint), np.zeros((njoint, 3)), np.zeros((njoint, 3, 3))
    links = np.array(whole.link_of)
    for i in reversed(range(njoint)):
        bodies = np.flatnonzero(links == i)
        if not bodies.size:  # the next joint is of the same body
            mass[i], inertia[i] = SHARE * mass[i + 1], SHARE * inertia[i + 1]
            com[i] = frames[i].T @ (origin[i + 1] + frames[i + 1] @ com[i + 1] - origin[i])
            continue
        weights = model.body_mass[bodies]
        mass[i] = weights.sum()
        centre = weights @ data.xipos[bodies] / mass[i]
        about = np.zeros((3, 3))
        for body, weight in zip(bodies, weights, strict=True):
            axes = data.ximat[body].reshape(3, 3)
            arm = data.xipos[body] - centre
            about += (axes * model.body_inertia[body]) @ axes.T
            about += weight * (arm @ arm * np.eye(3) - np.outer(arm, arm))  # parallel axes
        com[i] = frames[i].T @ (centre - origin[i])
        inertia[i] = frames[i].T @ about @ frames[i]
    return mass, com, 0.5 * (inertia + inertia.transpose(0, 2, 1))


def _actuators_on(whole: Whole) -> Sequence[tuple[int, int, float]]:
    """Every actuator that acts on a moving joint, with the number of the joint among them, and its gear."""
    model, kinds = whole.model, (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    return [
        (
            actuator,
            whole.joints.index(int(model.actuator_trnid[actuator, 0])),
            float(model.actuator_gear[model.actuator_outadr[actuator], 0]),
        )
        for actuator in range(model.nactuator)
        if int(model.actuator_trntype[actuator]) in kinds and int(model.actuator_trnid[actuator, 0]) in whole.joints
    ]


def _actuators_share(whole: Whole) -> tuple[Array, Array]:
    """What the actuators add to the rotors' inertia and to the viscous friction of the joints (njoint each)."""
    armature, damping = np.zeros(len(whole.joints)), np.zeros(len(whole.joints))
    for actuator, i, gear in _actuators_on(whole):
        armature[i] += gear**2 * whole.model.actuator_armature[actuator]
        damping[i] += gear**2 * whole.model.actuator_damping[actuator]
    return armature, damping


def _torque_limits(whole: Whole) -> Array:
    """What the motors can give (njoint), in N m or N, in the weaker direction; inf where the file does not say."""
    model = whole.model
    given = np.zeros(len(whole.joints))
    for actuator, i, gear in _actuators_on(whole):
        largest = np.inf
        if model.actuator_forcelimited[actuator]:
            largest = np.abs(model.actuator_forcerange[actuator]).min()
        control = model.actuator_ctrladr[actuator]
        is_fixed = model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
        is_straight = model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
        if is_fixed and is_straight and model.actuator_ctrllimited[control]:
            gain = abs(model.actuator_gainprm[actuator, 0])
            largest = min(largest, gain * np.abs(model.actuator_ctrlrange[control]).min())
        given[i] += abs(gear) * largest
    of_joints = np.abs(model.jnt_actfrcrange[whole.joints]).min(axis=1)
    said = (of_joints > 0) & (model.jnt_actfrclimited[whole.joints] > 0)
    limits: Array = np.minimum(np.where(given > 0, given, np.inf), np.where(said, of_joints, np.inf))
    return limits
