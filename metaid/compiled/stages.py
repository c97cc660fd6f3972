"""One step of a chain of hinges and slides by MuJoCo, in two halves: where links are, and where a torque takes them.

In between, the law of a planar chain reads cosines and sines off the rotation matrices that MuJoCo has just worked out.
MuJoCo cuts `mj_step` in two for this, `mj_step1` and `mj_step2`. They also look for contacts, tendons, actuators,
sensors, islands of constraints and bad numbers; the rest of their work is the calls that a direct `Step` is made of:
seven, and four more where there is dry friction, which is a constraint. These are the same machine code on the same
numbers, so the result is the same to the last bit. `agrees_with_mj_step` checks this on the very model that is to be
stepped.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import llvmlite.binding
import mujoco
import numpy as np
from numba import types

from metaid.compiled.decorator import compiled
from metaid.compiled.law import turn
from metaid.compiled.quiet import quiet_mujoco
from metaid.compiled.undocumented import LIBRARY, address_of
from metaid.models import Array
from metaid.plant import ArmPlant, MujocoPlant

llvmlite.binding.load_library_permanently(str(LIBRARY))

CHECKED_STEPS = 50  # after each of the states that `agrees_with_mj_step` starts from


def _stage(name: str, *more: Any) -> Any:
    """A function of MuJoCo's library that takes the addresses of model and data, and `more`."""
    return types.ExternalFunction(name, types.void(types.uintp, types.uintp, *more))


_mj_resetData = _stage("mj_resetData")  # noqa: N816, MuJoCo's own name
_mj_step1 = _stage("mj_step1")
_mj_step2 = _stage("mj_step2")
_mj_kinematics = _stage("mj_kinematics")
_mj_comPos = _stage("mj_comPos")  # noqa: N816, MuJoCo's own name
_mj_crb = _stage("mj_crb")
_mj_factorM = _stage("mj_factorM")  # noqa: N816
_mj_comVel = _stage("mj_comVel")  # noqa: N816
_mj_rne = _stage("mj_rne", types.intc, types.uintp)
_mj_solveM = _stage("mj_solveM", types.uintp, types.uintp, types.intc)  # noqa: N816
_mj_makeConstraint = _stage("mj_makeConstraint")  # noqa: N816
_mj_projectConstraint = _stage("mj_projectConstraint")  # noqa: N816
_mj_referenceConstraint = _stage("mj_referenceConstraint")  # noqa: N816
_mj_fwdConstraint = _stage("mj_fwdConstraint")  # noqa: N816


class Step(NamedTuple):
    """What a compiled loop steps with: MuJoCo's stages one by one where it `is_direct`, else `mj_step1` and `mj_step2`;
    that is None then, so that the type settles which when a loop is compiled.

    Views of the state, the applied torque (nlink), the links' rotation matrices (nlink x 9), the vectors that pass
    between the stages (nlink) and passive damping and stiffness (nlink); addresses; and whether there is dry friction.
    """

    qpos: Array
    qvel: Array
    torque: Array
    rotations: Array
    bias: Array
    smooth: Array
    acceleration: Array
    warm_start: Array
    damping: Array
    stiffness: Array
    model: int
    data: int
    bias_at: int
    smooth_at: int
    acceleration_at: int
    timestep: float
    is_dry: bool
    is_direct: bool | None


def mujoco_step(model: mujoco.MjModel, data: mujoco.MjData) -> Step:
    """`mj_step1` and `mj_step2` on these two, which must outlive it."""
    return direct_step(model, data)._replace(is_direct=None)


def direct_step(model: mujoco.MjModel, data: mujoco.MjData) -> Step:
    """MuJoCo's stages on these two, which must outlive it."""
    is_dry = bool(model.dof_frictionloss.any())
    vectors = data.qfrc_bias, data.qfrc_smooth, data.qacc, data.qacc_warmstart
    solved = data.qacc_smooth if is_dry else data.qacc  # what the solver of constraints goes on from, or the end
    bias_at, smooth_at, solved_at = (vector.ctypes.data for vector in (data.qfrc_bias, data.qfrc_smooth, solved))
    addresses = address_of(model), address_of(data), bias_at, smooth_at, solved_at
    passive = np.ravel(model.dof_damping), np.ravel(model.jnt_stiffness)
    views = data.qpos, data.qvel, data.qfrc_applied, data.xmat[1:]
    return Step(*views, *vectors, *passive, *addresses, model.opt.timestep, is_dry, True)


@compiled
def forget(chain):  # type: ignore[no-untyped-def]
    """Leaves nothing of the motion before in a `Step`, but for what is in `qpos` and `qvel`.

    MuJoCo's solver of dry friction starts from the last solution, to which it would lead a little nearer than from
    anywhere else. The stages begin all else afresh.
    """
    if chain.is_direct is None or chain.is_dry:
        _mj_resetData(chain.model, chain.data)


@compiled
def look(chain, links, stiffness):  # type: ignore[no-untyped-def]
    """The first half of a timestep; turns the `links` to where they are, for a law with this `stiffness`.

    Hinges about y: the matrix of a link at the absolute angle φ begins with cos φ, 0, sin φ.
    """
    _begin(chain)
    for i in range(chain.rotations.shape[0]):
        turn(links[i], chain.rotations[i, 0], chain.rotations[i, 2], stiffness)


@compiled
def advance(chain):  # type: ignore[no-untyped-def]
    """The second half, with the torque in `chain`."""
    if chain.is_direct is None:
        _mj_step2(chain.model, chain.data)
    else:
        _advance_directly(chain)


@compiled
def step_plant(chain):  # type: ignore[no-untyped-def]
    """A whole timestep."""
    _begin(chain)
    advance(chain)


@compiled
def _begin(chain):  # type: ignore[no-untyped-def]
    if chain.is_direct is None:
        _mj_step1(chain.model, chain.data)
    else:
        _mj_kinematics(chain.model, chain.data)


@compiled
def _advance_directly(chain):  # type: ignore[no-untyped-def]
    model, data = chain.model, chain.data
    _mj_comPos(model, data)
    _mj_crb(model, data)
    _mj_factorM(model, data)
    if chain.is_dry:
        _mj_makeConstraint(model, data)
        _mj_projectConstraint(model, data)
    _mj_comVel(model, data)
    if chain.is_dry:
        _mj_referenceConstraint(model, data)
    _mj_rne(model, data, 0, chain.bias_at)
    for i in range(chain.qvel.shape[0]):
        passive = -chain.stiffness[i] * chain.qpos[i] - chain.damping[i] * chain.qvel[i]
        chain.smooth[i] = passive - chain.bias[i] + chain.torque[i]
    _mj_solveM(model, data, chain.acceleration_at, chain.smooth_at, 1)
    if chain.is_dry:
        _mj_fwdConstraint(model, data)
        for i in range(chain.qvel.shape[0]):
            chain.warm_start[i] = chain.acceleration[i]
    for i in range(chain.qvel.shape[0]):
        chain.qvel[i] += chain.timestep * chain.acceleration[i]
        chain.qpos[i] += chain.timestep * chain.qvel[i]


@compiled
def _advance_many(chain, steps):  # type: ignore[no-untyped-def]
    for _ in range(steps):
        step_plant(chain)


def agrees_with_mj_step(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Whether a direct `Step` is `mj_step` to the last bit on this model; leaves `data` at rest.

    Compared after a number of steps from random states with random torques, fast and large ones among them.
    """
    single = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
    if model.nv == 0 or not np.isin(model.jnt_type, [int(kind) for kind in single]).all():
        return False
    random, chain, same = np.random.default_rng(0), direct_step(model, data), True
    for size in (0.1, 1.0, 5.0):
        angles, speeds, torque = size * random.standard_normal((3, model.nv))
        states = []
        for direct in (False, True):
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:], data.qfrc_applied[:] = angles, speeds, torque
            if direct:
                _advance_many(chain, CHECKED_STEPS)
            else:
                mujoco.mj_step(model, data, CHECKED_STEPS)
            states.append((data.qpos.tobytes(), data.qvel.tobytes()))
        same = same and states[0] == states[1]
    mujoco.mj_resetData(model, data)
    return same


def fastest_step(plant: MujocoPlant | ArmPlant) -> Step:
    """How a compiled loop moves `plant` on: MuJoCo's stages one by one, or `mj_step` where these are not the same to
    the last bit.
    """
    with quiet_mujoco():
        make = direct_step if agrees_with_mj_step(plant.model, plant.data) else mujoco_step
    return make(plant.model, plant.data)
