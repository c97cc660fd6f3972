"""The lean MuJoCo model of an arm, or of a planar chain as the arm that it is: joints and inertials alone.

It is made from a `Tree`, so that the plant, the nominal arm, and every candidate are simulated alike.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from metaid.errors import usable_mujoco
from metaid.models import Array, Chain
from metaid.models.tree import Tree, planar_tree, tilted_gravity

with usable_mujoco():  # for all of the package: the modules that read descriptions take MuJoCo from here
    import mujoco

SOLVED = 1e-15  # MuJoCo's own 1e-8 leaves as much of dry friction's acceleration wrong
TOLERANCE = 1e-8  # of the solver of a chain where there is dry friction: MuJoCo's own
LEAST = 1e-14  # kg m² or kg: MuJoCo compiles no moving body of less than 1e-15


def build_arm_spec(tree: Tree, timestep: float) -> mujoco.MjSpec:
    """A lean MuJoCo arm: `link_i`, from 1, hangs on the joint of the tree's i-th name. Shapes may be added to it.

    Inertials are those of the tree as far as MuJoCo compiles them; `set_parameters` writes them exactly. Joints have no
    limits: an episode stays within them, and a push that does not is a fall. The `timestep` is in s.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep
    spec.option.gravity = tree.gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.tolerance = SOLVED
    spec.option.disableflags = _disabled(tree)
    spec.compiler.degree = False
    spec.compiler.autolimits = False
    body = spec.worldbody
    for i in range(tree.njoint):
        inertia, rotation = _principal(tree.inertia[i])
        inertia = np.maximum(inertia, LEAST)
        body = body.add_body(
            name=f"link_{i + 1}",
            pos=tree.position[i],
            quat=_quaternion(tree.rotation[i]),
            mass=max(tree.mass[i], LEAST),
            ipos=tree.com[i],
            iquat=rotation,
            # Rounding may put the largest a bit above the sum of the others, which MuJoCo refuses.
            inertia=[inertia[0], inertia[1], min(inertia[2], inertia[:2].sum())],
            explicitinertial=True,
            simple=0,  # MuJoCo would take short cuts that hold for these inertials alone
        )
        slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
        body.add_joint(
            name=tree.names[i],
            type=slide if tree.slides[i] else hinge,
            axis=tree.axis[i],
            armature=tree.rotor[i],
            damping=[tree.damping[i], 0.0, 0.0],
            frictionloss=tree.coulomb[i],
        )
    return spec


def build_spec(chain: Chain, gravity: float, timestep: float, tilt: float = 0.0) -> mujoco.MjSpec:
    """A planar chain: hinges about y with their springs, on a base that may be tilted. What is drawn is this with
    shapes added (`show/scene.py`), so it moves alike.

    Args:
        chain: the links; body i of the spec is named `link_i`, and its joint `joint_i`, from 1.
        gravity: in m/s².
        timestep: in s.
        tilt: of the base, in rad, positive towards positive angles.
    """
    tree = planar_tree(chain, gravity)
    spec = build_arm_spec(replace(tree, gravity=tilted_gravity(tree.gravity, np.array([0.0, tilt]))), timestep)
    spec.option.tolerance = TOLERANCE
    for name, stiffness in zip(tree.names, chain.stiffness.tolist(), strict=True):
        spec.joint(name).stiffness = [stiffness, 0.0, 0.0]
    return spec


def arm_model(
    tree: Tree, timestep: float, stiffness: Array | float = 0.0, slack: Array | float = 0.0
) -> mujoco.MjModel:
    """The compiled lean model of an arm.  Raises ValueError where MuJoCo cannot compile it.

    Args:
        tree: whose links must be possible bodies.
        timestep: in s.
        stiffness: of springs in its joints (njoint), in N m/rad or N/m.
        slack: the joint coordinates at which these are (njoint), in rad or m.
    """
    model = build_arm_spec(tree, timestep).compile()
    set_parameters(model, tree)
    model.jnt_stiffness[:], model.qpos_spring[:] = stiffness, slack
    return model


def set_parameters(model: mujoco.MjModel, tree: Tree) -> None:
    """Writes the parameters of a tree into a lean `model` of one with the same kinematics. They need not be of possible
    bodies.
    """
    model.body_mass[1:], model.body_ipos[1:] = tree.mass, tree.com
    for i in range(tree.njoint):
        model.body_inertia[i + 1], model.body_iquat[i + 1] = _principal(tree.inertia[i])
    model.dof_armature[:], model.dof_damping[:], model.dof_frictionloss[:] = tree.rotor, tree.damping, tree.coulomb
    model.opt.disableflags = _disabled(tree)
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _disabled(tree: Tree) -> int:
    """What the lean model does without. Dry friction is a constraint, so only an arm that has some needs the solver;
    viscous friction is explicit, at the speed that a step begins with, as the law's is. Autoreset is off: a diverged
    episode must not silently restart.
    """
    off = mujoco.mjtDisableBit
    return int(
        (0 if tree.coulomb.any() else off.mjDSBL_CONSTRAINT)
        | off.mjDSBL_CONTACT
        | off.mjDSBL_AUTORESET
        | off.mjDSBL_SENSOR
        | off.mjDSBL_ACTUATION
        | off.mjDSBL_EULERDAMP
    )


def _principal(inertia: Array) -> tuple[Array, Array]:
    """Principal moments (3), ascending, of an `inertia` (3 x 3), and the quaternion (4) of their axes."""
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return moments, _quaternion(axes)


def _quaternion(rotation: Array) -> Array:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, rotation.ravel())
    return quaternion
