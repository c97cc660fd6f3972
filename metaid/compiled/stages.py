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
    """What a compiled loop steps with: views of the state, the applied torque (nlink) and the links' rotation matrices
    (nlink x 9), two addresses; and whether it `is_direct`, MuJoCo's stages called one by one, or None for `mj_step1`
    and `mj_step2`: which it is, is then settled by the type when a loop is compiled. The stages also need the vectors
    that pass between them (nlink), and whether there is dry friction.
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


def step_of(model: mujoco.MjModel, data: mujoco.MjData, is_direct: bool) -> Step:
    """MuJoCo's stages, or `mj_step1` and `mj_step2`, on these two, which must outlive it."""
    is_dry = bool(model.dof_frictionloss.any())
    vectors = data.qfrc_bias, data.qfrc_smooth, data.qacc, data.qacc_warmstart
    solved = data.qacc_smooth if is_dry else data.qacc  # what the solver of constraints goes on from, or the end
    bias_at, smooth_at, solved_at = (vector.ctypes.data for vector in (data.qfrc_bias, data.qfrc_smooth, solved))
    addresses = address_of(model), address_of(data), bias_at, smooth_at, solved_at
    passive = np.ravel(model.dof_damping), np.ravel(model.jnt_stiffness)
    views = data.qpos, data.qvel, data.qfrc_applied, data.xmat[1:]
    return Step(*views, *vectors, *passive, *addresses, model.opt.timestep, is_dry, is_direct or None)


@compiled
def forget(chain):  # type: ignore[no-untyped-def]
    """Leaves nothing of the motion before in a `Step`, but for what is in `qpos` and `qvel`.

    The stages begin all afresh but the solver of dry friction: it starts from the last solution, to which it would lead
    a little nearer than from anywhere else.
    """
    if chain.is_direct is None or chain.is_dry:
        _mj_resetData(chain.model, chain.data)


@compiled
def _place(chain):  # type: ignore[no-untyped-def]
    """The first half of a timestep: where the links are."""
    if chain.is_direct is None:
        _mj_step1(chain.model, chain.data)
    else:
        _mj_kinematics(chain.model, chain.data)


@compiled
def look(chain, links, stiffness):  # type: ignore[no-untyped-def]
    """The same; turns the `links` to their angles, for a law with this `stiffness`. Hinges are about y: the matrix of a
    link at the absolute angle φ begins with cos φ, 0, sin φ.
    """
    _place(chain)
    rotations = chain.rotations
    for i in range(rotations.shape[0]):
        turn(links[i], rotations[i, 0], rotations[i, 2], stiffness)


@compiled
def advance(chain):  # type: ignore[no-untyped-def]
    """The second half, with the torque in `chain`."""
    model, data = chain.model, chain.data
    if chain.is_direct is None:
        _mj_step2(model, data)
        return
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
def step_plant(chain):  # type: ignore[no-untyped-def]
    """A whole timestep of a `Step`."""
    _place(chain)
    advance(chain)


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
    random, chain, same = np.random.default_rng(0), step_of(model, data, True), True
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
        is_direct = agrees_with_mj_step(plant.model, plant.data)
    return step_of(plant.model, plant.data, is_direct)
