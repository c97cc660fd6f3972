"""What moves or is moved in a file, but is no arm: one line that says what is met, and what is allowed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise, takewhile

import numpy as np

from metaid.errors import BranchesError, PlantError, unknown
from metaid.plant.description.fusing import Whole, body_name, joint_name
from metaid.plant.lean import mujoco

MOST = 64  # joints, as many as a planar chain may have
LARGEST = 1e6  # of every number in SI units: nobody has an arm that needs more
LEAVE_OUT = "joints = [names] (--joints A,B) of those that move, the others are held"


def moving_joints(source: str, model: mujoco.MjModel, wanted: Sequence[str] | None) -> list[int]:
    """The numbers of the joints that move (njoint), from the base on: those that are `wanted`, by name, or else all but
    those of short branches, as fingers and a head are.

    Raises PlantError where there is no such joint, or they are not hinges and slides, BranchesError where they are not
    in series.
    """
    names = [joint_name(model, joint) for joint in range(model.njnt)]
    kinds = {mujoco.mjtJoint.mjJNT_FREE: "a floating base", mujoco.mjtJoint.mjJNT_BALL: "a ball joint"}
    types = [int(kind) for kind in model.jnt_type]  # no NumPy integer is found among MuJoCo's kinds
    allowed = [name for name, kind in zip(names, types, strict=True) if kind not in kinds]
    for name in wanted or ():
        if name not in allowed:
            kind = kinds[types[names.index(name)]] if name in names else None
            met = (
                f"joint '{name}' is {kind} (allowed: {', '.join(allowed)})" if kind else unknown("joint", name, allowed)
            )
            raise PlantError(f"{source}: joints: {met}")
    joints = _trunk(model) if wanted is None else [i for i, name in enumerate(names) if name in wanted]
    for joint in joints:
        kind = kinds.get(types[joint])
        if kind:
            raise PlantError(f"{source}: joint '{names[joint]}' is {kind} (allowed: hinges and slides; or {LEAVE_OUT})")
    if not joints:
        raise PlantError(f"{source}: no joint moves (allowed: hinges and slides in series)")
    for before, after in pairwise(joints):
        if int(model.jnt_bodyid[before]) not in _to_base(model, int(model.jnt_bodyid[after])):
            series = [[names[joint] for joint in each] for each in _series(model)]
            longest = max(series, key=lambda each: len(each))
            slides = [name for name, kind in zip(names, types, strict=True) if kind == mujoco.mjtJoint.mjJNT_SLIDE]
            raise BranchesError(
                f"{source}: joints '{names[before]}' and '{names[after]}' are on different branches (allowed: joints "
                f"in series, as {','.join(longest)}; or {LEAVE_OUT})",
                series,
                slides,
            )
    if len(joints) > MOST:
        raise PlantError(f"{source}: {len(joints)} joints move (allowed: at most {MOST}; or {LEAVE_OUT})")
    return joints


def _trunk(model: mujoco.MjModel) -> list[int]:
    """The numbers of the joints from the base to where the longest series of a file part; of all where a branch that
    leaves them has more than half as many, or one is no hinge and no slide.
    """
    series, every = _series(model), list(range(model.njnt))
    if len({joint for each in series for joint in each}) < len(every):
        return every
    longest = max(map(len, series), default=0)
    alike = [each for each in series if len(each) == longest]
    trunk = [joints[0] for joints in takewhile(lambda joints: len(set(joints)) == 1, zip(*alike, strict=True))]
    branches = [len(set(each) - set(trunk)) for each in series]
    return trunk if 2 * max(branches, default=0) <= len(trunk) else every


def _series(model: mujoco.MjModel) -> list[tuple[int, ...]]:
    """The numbers of the hinges and slides from the base to each body that has one, those included."""
    series: dict[int, tuple[int, ...]] = {}
    for joint, kind in enumerate(model.jnt_type.tolist()):
        if kind in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            body = int(model.jnt_bodyid[joint])
            before = next((series[each] for each in _to_base(model, body) if each in series), ())
            series[body] = (*before, joint)
    return list(series.values())


def _to_base(model: mujoco.MjModel, body: int) -> Iterator[int]:
    """A body, and all that carry it."""
    yield body
    while body:
        body = int(model.body_parentid[body])
        yield body


def refuse_what_is_no_arm(source: str, whole: Whole) -> None:
    """Raises PlantError where something else than weight, inertia, rotors, springs and friction moves the joints."""
    for met, allowed in (
        *_too_large(whole.model),
        *_of_joints(whole),
        *_of_the_whole(whole.model),
        *_equalities(whole),
        *_tendons(whole),
        *_actuators(whole),
    ):
        raise PlantError(f"{source}: {met} (allowed: {allowed})")


def _too_large(model: mujoco.MjModel) -> Iterator[tuple[str, str]]:
    """Numbers with which nothing can be computed."""
    numbers: dict[str, tuple[str, Callable[[int], str]]] = {
        "body": ("pos ipos mass inertia", lambda body: f"body '{body_name(model, body)}'"),
        "jnt": ("pos range stiffness", lambda joint: f"joint '{joint_name(model, joint)}'"),
        "dof": (
            "armature damping frictionloss",
            lambda degree: f"joint '{joint_name(model, int(model.dof_jntid[degree]))}'",
        ),
        "geom": ("pos size", lambda geom: f"a shape of body '{body_name(model, int(model.geom_bodyid[geom]))}'"),
        "actuator": ("armature damping", lambda number: f"actuator '{model.actuator(number).name or number + 1}'"),
    }
    for kind, (keys, named) in numbers.items():
        for key in keys.split():
            for index, value in enumerate(getattr(model, f"{kind}_{key}")):
                if (np.abs(value) <= LARGEST).all():
                    continue
                met = f"{named(index)} has {'pos' if key == 'ipos' else key} {np.abs(value).max():g}"
                yield met, f"numbers up to {LARGEST:g}"
    for what, values in (
        ("gravity", model.opt.gravity),
        ("ref", model.qpos0),
        ("springref", model.qpos_spring),
        ("gear", model.actuator_gear),
    ):
        if not (np.abs(values) <= LARGEST).all():
            yield f"{what} {np.abs(values).max():g} is met", f"numbers up to {LARGEST:g}"


def _of_joints(whole: Whole) -> Iterator[tuple[str, str]]:
    model = whole.model
    for joint, degree in zip(whole.joints, whole.degrees, strict=True):
        name = joint_name(model, joint)
        if model.jnt_stiffnesspoly[joint].any() and not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_SPRING:
            yield f"joint '{name}' has a spring whose torque is no multiple of its angle", "one number as stiffness"
        if model.dof_dampingpoly[degree].any():
            yield f"joint '{name}' has viscous friction that is no multiple of its speed", "one number as damping"


def _of_the_whole(model: mujoco.MjModel) -> Iterator[tuple[str, str]]:
    for body in np.flatnonzero(model.body_gravcomp):
        yield f"body '{body_name(model, int(body))}' is relieved of its weight by gravcomp", "gravcomp 0"
    if model.opt.density or model.opt.viscosity:
        yield "the arm moves in a fluid", "density 0 and viscosity 0"


def _equalities(whole: Whole) -> Iterator[tuple[str, str]]:
    """Constraints that close a loop or couple joints, but not those between parts of one body."""
    model, kind, links = whole.model, mujoco.mjtEq, whole.link_of
    for equality in np.flatnonzero(model.eq_active0):
        name = model.equality(equality).name or str(equality + 1)
        ends = (int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality]))
        if model.eq_type[equality] == kind.mjEQ_JOINT:
            for joint in ends:
                if joint in whole.joints:
                    met = f"equality constraint '{name}' couples joint '{joint_name(model, joint)}'"
                    yield met, f"joints that move freely; or {LEAVE_OUT}"
        elif int(model.eq_type[equality]) in (kind.mjEQ_CONNECT, kind.mjEQ_WELD):
            on_sites = model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE
            first, second = (links[model.site_bodyid[end] if on_sites else end] for end in ends)
            if first != second:
                yield f"equality constraint '{name}' closes a loop", "joints in series, without loops"
        else:
            yield f"equality constraint '{name}' is on no joint and no body", "none"


def _tendons(whole: Whole) -> Iterator[tuple[str, str]]:
    model, wraps = whole.model, mujoco.mjtWrap
    forces = ("stiffness", "stiffnesspoly", "damping", "dampingpoly", "frictionloss", "armature")
    links = whole.link_of
    for tendon in range(model.ntendon):
        first = model.tendon_adr[tendon]
        touched = set()
        for wrap in range(first, first + model.tendon_num[tendon]):
            what, kind = int(model.wrap_objid[wrap]), int(model.wrap_type[wrap])
            if kind == wraps.mjWRAP_JOINT:
                touched |= {what} & set(whole.joints)
                touched |= {-1}
            elif kind == wraps.mjWRAP_SITE:
                touched.add(links[model.site_bodyid[what]])
            elif kind in (wraps.mjWRAP_SPHERE, wraps.mjWRAP_CYLINDER):
                touched.add(links[model.geom_bodyid[what]])
        met = [force for force in forces if np.any(getattr(model, f"tendon_{force}")[tendon])]
        if len(touched) > 1 and met and tendon not in whole.couples:
            name = model.tendon(tendon).name or str(tendon + 1)
            yield f"tendon '{name}' has a {met[0].removesuffix('poly')} of its own", "joints in series, without tendons"


def _actuators(whole: Whole) -> Iterator[tuple[str, str]]:
    """Actuators are taken away. Their states are not: what such a motor does depends on what was before."""
    model, kinds = whole.model, (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    for actuator in range(model.nactuator):
        name = model.actuator(actuator).name or str(actuator + 1)
        on_joint = int(model.actuator_trntype[actuator]) in kinds
        if on_joint and int(model.actuator_trnid[actuator, 0]) not in whole.joints:
            continue
        if model.actuator_actnum[actuator]:
            yield f"actuator '{name}' has dynamics of its own, an activation state", "actuators without one, or none"
        if model.actuator_dampingpoly[actuator].any():
            yield f"actuator '{name}' has viscous friction that is no multiple of the speed", "one number as damping"
        if not on_joint and (model.actuator_damping[actuator] or model.actuator_armature[actuator]):
            yield f"actuator '{name}' has damping or armature, and is on no joint", "give them to the joints"
