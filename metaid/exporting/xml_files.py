"""An identified model as MJCF and as URDF: joints and inertials, without shapes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from metaid.models import Array
from metaid.models.tree import JointFriction, Spring, Tree

UNKNOWN = 1e9  # a URDF must name a limit of speed and torque: where none is known it is this, in SI units
STANDARD_GRAVITY = (0.0, 0.0, -9.81)  # what those who read a URDF, which has none, take
RIGID = 0.99  # impedance of dry friction (solimp); MuJoCo's own 0.9 lets a light joint creep
_MOMENTS = (0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)


def _springs(friction: JointFriction | None) -> list[Spring]:
    """The springs beside a `friction`; a constant torque in their joints moves where they are slack."""
    if friction is None:
        return []
    stiffness, offset = friction.of("spring"), friction.of("offset")
    joints = np.flatnonzero(stiffness)
    slack = -offset[joints] / stiffness[joints]
    return list(map(Spring, joints.tolist(), stiffness[joints].tolist(), slack.tolist()))


def _couples(tree: Tree, friction: JointFriction | None) -> Iterator[tuple[tuple[str, str], list[float]]]:
    """Of each motor that turns with the sum of two joints their names, the inertia of its rotor, in kg m², and its
    viscous and dry friction, in N m s and N m; none of friction by the root of the speed.
    """
    if friction is not None:
        columns = friction.coupled_rotor, *(friction.of(term)[tree.njoint :] for term in ("viscous", "coulomb"))
        for (first, second), *row in zip(friction.sliding.coupled, *(each.tolist() for each in columns), strict=True):
            yield (tree.names[first], tree.names[second]), row


def not_in_xml(friction: JointFriction) -> list[str]:
    """What neither an MJCF nor a URDF can say of a `friction`, in sentences without a full stop."""
    terms = {
        "dry friction that grows with load": friction.of("load").any(),
        "friction by the root of the speed": friction.of("root").any(),
        "pre-sliding": friction.sliding.builds_up,
        "dry friction that bends near rest": friction.sliding.bent.any(),
        "constant torque": friction.of("offset")[friction.of("spring") == 0.0].any(),
    }
    return [f"this format has no {term}" for term, is_there in terms.items() if is_there]


def mjcf(
    tree: Tree,
    name: str,
    timestep: float,
    heading: Sequence[str],
    friction: JointFriction | None = None,
) -> str:
    """An MJCF that MuJoCo loads as it is. A motor that turns with the sum of two joints is a fixed tendon over both.

    Dry friction is as sharp as MuJoCo lets it be at this timestep, two of which are its time constant, and nearly
    rigid, so that a light joint sticks, too.

    Args:
        tree: the model, of possible bodies.
        name: of the model.
        timestep: in s.
        heading: lines of the comment at the top.
        friction: whose springs and coupled motors it has besides the tree.
    """
    root, sprung = Element("mujoco", model=name), {spring.joint: spring for spring in _springs(friction)}
    SubElement(root, "compiler", angle="radian", autolimits="true")
    SubElement(root, "option", timestep=_text(timestep), gravity=_text(*tree.gravity), integrator="Euler")
    body = SubElement(root, "worldbody")
    for i in range(tree.njoint):
        body = SubElement(body, "body", name=f"link_{i + 1}", pos=_text(*tree.position[i]))
        if (tree.rotation[i] != np.eye(3)).any():
            body.set("xyaxes", _text(*tree.rotation[i][:, :2].T.ravel()))
        moments = [tree.inertia[i][at] for at in _MOMENTS]
        inertial = {"mass": _text(tree.mass[i]), "pos": _text(*tree.com[i]), "fullinertia": _text(*moments)}
        SubElement(body, "inertial", inertial)
        kind = "slide" if tree.slides[i] else "hinge"
        joint = SubElement(body, "joint", name=tree.names[i], type=kind, axis=_text(*tree.axis[i]))
        if np.isfinite([tree.low[i], tree.high[i]]).all():
            joint.set("range", _text(tree.low[i], tree.high[i]))
        if math.isfinite(tree.torque_limit[i]):
            joint.set("actuatorfrcrange", _text(-tree.torque_limit[i], tree.torque_limit[i]))
        if i in sprung:
            joint.set("stiffness", _text(sprung[i].stiffness))
            joint.set("springref", _text(sprung[i].slack))
        _set_moved(joint, (tree.rotor[i], tree.damping[i], tree.coulomb[i]), timestep)
    couples = list(_couples(tree, friction))
    tendons = SubElement(root, "tendon") if couples else root
    for (first, second), resisting in couples:
        tendon = SubElement(tendons, "fixed", name=f"{first}+{second}")
        _set_moved(tendon, resisting, timestep)
        for each in (first, second):
            SubElement(tendon, "joint", joint=each, coef="1")
    return _written(root, heading)


def _set_moved(moved: Element, resisting: Sequence[float], timestep: float) -> None:
    """Says what resists a joint or a tendon, a rotor, viscous and dry friction; what is 0 is left out."""
    for key, value in zip(("armature", "damping", "frictionloss"), resisting, strict=True):
        if value:
            moved.set(key, _text(value))
    if resisting[-1]:
        moved.set("solreffriction", _text(2.0 * timestep, 1.0))
        moved.set("solimpfriction", _text(RIGID, RIGID))


def urdf(tree: Tree, name: str, heading: Sequence[str]) -> str:
    """A URDF. It has neither rotors nor gravity.

    Args:
        tree: the model, of possible bodies.
        name: of the model.
        heading: lines of the comment at the top.
    """
    root = Element("robot", name=name)
    SubElement(root, "link", name="base")
    before = "base"
    for i in range(tree.njoint):
        link = f"link_{i + 1}"
        inertial = SubElement(SubElement(root, "link", name=link), "inertial")
        SubElement(inertial, "origin", xyz=_text(*tree.com[i]), rpy="0 0 0")
        SubElement(inertial, "mass", value=_text(tree.mass[i]))
        names = ("i" + "xyz"[row] + "xyz"[column] for row, column in _MOMENTS)
        moments = (_text(tree.inertia[i][at]) for at in _MOMENTS)
        SubElement(inertial, "inertia", dict(zip(names, moments, strict=True)))
        is_limited = bool(np.isfinite([tree.low[i], tree.high[i]]).all())
        kind = "prismatic" if tree.slides[i] else "revolute" if is_limited else "continuous"
        joint = SubElement(root, "joint", name=tree.names[i], type=kind)
        SubElement(joint, "parent", link=before)
        SubElement(joint, "child", link=link)
        SubElement(joint, "origin", xyz=_text(*tree.position[i]), rpy=_text(*_roll_pitch_yaw(tree.rotation[i])))
        SubElement(joint, "axis", xyz=_text(*tree.axis[i]))
        limit = SubElement(joint, "limit", effort=_text(min(tree.torque_limit[i], UNKNOWN)), velocity=_text(UNKNOWN))
        if kind != "continuous":
            limit.set("lower", _text(max(tree.low[i], -UNKNOWN)))
            limit.set("upper", _text(min(tree.high[i], UNKNOWN)))
        SubElement(joint, "dynamics", damping=_text(tree.damping[i]), friction=_text(tree.coulomb[i]))
        before = link
    return _written(root, heading)


def without_springs(tree: Tree, friction: JointFriction | None) -> list[str]:
    """What a file lacks that holds no springs, in sentences without a full stop."""
    named = ((tree.names[each.joint], each.text(bool(tree.slides[each.joint]))) for each in _springs(friction))
    return [f"this file has no springs; joint {name} has one of {text}" for name, text in named]


def not_in_urdf(tree: Tree, friction: JointFriction | None = None) -> list[str]:
    """What a URDF cannot say of a `tree` and of motors that turn with the sum of two joints, in sentences."""
    said = []
    if tree.rotor.any():
        rotors = ", ".join(
            f"{name} {value:.6g} {'kg' if is_slide else 'kg m²'}"
            for name, value, is_slide in zip(tree.names, tree.rotor.tolist(), tree.slides.tolist(), strict=True)
            if value
        )
        said.append(f"a URDF has no inertia of rotors; add to the mass matrix: {rotors}")
    for (first, second), (rotor, viscous, coulomb) in _couples(tree, friction):
        said.append(
            f"a URDF has no motor that turns with the sum of {first} and {second}; it has {rotor:.6g} kg m², "
            f"viscous friction {viscous:.6g} N m s, dry friction {coulomb:.6g} N m"
        )
    if not np.allclose(tree.gravity, STANDARD_GRAVITY, rtol=0.0, atol=1e-12):
        said.append(f"a URDF has no gravity; it is {_text(*tree.gravity)} m/s² in the frame of the base")
    return said


def _roll_pitch_yaw(rotation: Array) -> tuple[float, float, float]:
    """Angles about fixed x, y, z, in rad, whose rotation is `rotation` (3 x 3) to rounding, whatever the pitch."""
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    sine, cosine = math.sin(yaw), math.cos(yaw)
    pitch = math.atan2(-rotation[2, 0], cosine * rotation[0, 0] + sine * rotation[1, 0])
    roll = math.atan2(sine * rotation[0, 2] - cosine * rotation[1, 2], cosine * rotation[1, 1] - sine * rotation[0, 1])
    return roll, pitch, yaw


def _text(*numbers: float) -> str:
    """Numbers to the last digit."""
    return " ".join(repr(float(number) + 0.0) for number in numbers)


def _written(root: Element, heading: Sequence[str]) -> str:
    ElementTree.indent(root)
    lines = "\n".join(f"  {line}" for line in heading).replace("--", "- -")
    return f"<!--\n{lines}\n-->\n{ElementTree.tostring(root, encoding='unicode')}\n"
