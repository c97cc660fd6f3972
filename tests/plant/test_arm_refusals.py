"""Files that are no serial arm, or say what cannot be, are refused in one line that says why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from arm_files import URDF, read, two

from metaid.errors import PlantError
from metaid.plant import ArmSettings
from metaid.plant.description import read_arm
from metaid.plant.description.compiling import compile_file
from metaid.plant.description.fusing import Whole, fuse
from metaid.plant.description.reading import refuse_another_motion
from metaid.plant.description.refusing import moving_joints

REFUSED = {
    "floating base": (
        {"base": "<freejoint/>"},
        "joint 'joint_1' is a floating base (allowed: hinges and slides; or joints",
    ),
    "ball": (
        {"base": "<joint name='b' type='ball'/>"},
        "joint 'b' is a ball joint (allowed: hinges and slides; or joints",
    ),
    "branch": (
        {"beside": "<body name='hand'><joint name='hand'/><geom size='0.1'/></body>"},
        "joints 'elbow' and 'hand' are on different branches (allowed: joints in series, as shoulder,elbow; or joints",
    ),
    "spring": (
        {"joint": "stiffness='3 1'"},
        "joint 'shoulder' has a spring whose torque is no multiple of its angle (allowed: one number as stiffness)",
    ),
    "stiff": ({"joint": "stiffness='1e9'"}, "joint 'shoulder' has stiffness 1e+09 (allowed: numbers up to 1e+06)"),
    "friction": (
        {"joint": "damping='0.1 0.2'"},
        "joint 'shoulder' has viscous friction that is no multiple of its speed",
    ),
    "weightless": (
        {"upper": "gravcomp='1'"},
        "body 'upper' is relieved of its weight by gravcomp (allowed: gravcomp 0)",
    ),
    "fluid": ({"option": "density='1.2'"}, "the arm moves in a fluid (allowed: density 0 and viscosity 0)"),
    "loop": (
        {"after": "<equality><connect name='loop' body1='fore' anchor='0 0 0'/></equality>"},
        "equality constraint 'loop' closes a loop (allowed: joints in series, without loops)",
    ),
    "coupled joints": (
        {"after": "<equality><joint joint1='elbow' joint2='shoulder'/></equality>"},
        "equality constraint '1' couples joint 'elbow' (allowed: joints that move freely; or joints = [names]",
    ),
    "tendon": (
        {"after": "<tendon><fixed name='t' damping='1'><joint joint='elbow' coef='1'/></fixed></tendon>"},
        "tendon 't' has a damping of its own (allowed: joints in series, without tendons)",
    ),
    "loop of sites": (
        {
            "within": "<site name='one'/>",
            "beside": "<site name='two'/>",
            "after": "<equality><weld name='loop' site1='one' site2='two'/></equality>",
        },
        "equality constraint 'loop' closes a loop (allowed: joints in series, without loops)",
    ),
    "tendon across": (
        {
            "within": "<site name='one'/>",
            "beside": "<site name='two'/>",
            "after": "<tendon><spatial name='t' stiffness='1'><site site='one'/><site site='two'/></spatial></tendon>",
        },
        "tendon 't' has a stiffness of its own (allowed: joints in series, without tendons)",
    ),
    "friction of an actuator": (
        {"after": "<actuator><motor name='m' joint='elbow' damping='1 2'/></actuator>"},
        "actuator 'm' has viscous friction that is no multiple of the speed (allowed: one number as damping)",
    ),
    "actuator of a tendon": (
        {
            "after": "<tendon><fixed name='t'><joint joint='elbow' coef='1'/></fixed></tendon>"
            "<actuator><motor name='m' tendon='t' armature='1'/></actuator>"
        },
        "actuator 'm' has damping or armature, and is on no joint (allowed: give them to the joints)",
    ),
    "activation": (
        {"after": "<actuator><intvelocity name='m' joint='elbow' kp='1' actrange='-1 1'/></actuator>"},
        "actuator 'm' has dynamics of its own, an activation state (allowed: actuators without one, or none)",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_file_that_is_no_serial_arm_is_refused(tmp_path: Path, name: str) -> None:
    """One line names what is met, and what is allowed."""
    pieces, message = REFUSED[name]
    with pytest.raises(PlantError) as refused:
        read(tmp_path, two(**pieces))
    assert str(refused.value).startswith(f"arm.toml: arm.xml: {message}")


def test_force_that_nobody_thought_of_is_refused(tmp_path: Path) -> None:
    """Where the lean model does not move as the file does, the joint and the force are named."""
    (tmp_path / "arm.xml").write_text(two(joint="damping='3'"), encoding="utf-8")
    model = compile_file(tmp_path / "arm.xml", is_urdf=False).model
    whole = Whole(model, moving_joints("arm.xml", model, None), model.qpos0)
    tree = fuse(whole)
    still = replace(tree, damping=0.0 * tree.damping)
    for other, what in ((still, "passive force"), (replace(tree, rotor=tree.rotor + 1.0), "inertia")):
        with pytest.raises(PlantError, match=rf"joint 'shoulder' feels more {what} than that of its links \(allowed"):
            refuse_another_motion("arm.xml", whole, other, 0.002)


BAD = {
    "unknown joint": (
        {"joints": ["elbw"]},
        "arm.toml: arm.xml: joints: unknown joint 'elbw'; did you mean 'elbow'? (allowed",
    ),
    "unknown home": ({"home": {"wrist": 0.1}}, "arm.toml: home: unknown joint 'wrist' (allowed: shoulder, elbow)"),
    "unknown rotor": ({"rotor": {"wrist": 0.1}}, "arm.toml: rotor: unknown joint 'wrist' (allowed: shoulder, elbow)"),
    "home beyond": (
        {"home": {"shoulder": 2.5}},
        "arm.toml: home: shoulder: 2.5 is beyond its range (allowed: -1 to 2)",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_entry_of_a_plant_file_is_refused(tmp_path: Path, name: str) -> None:
    """One line says which entry, and what is allowed."""
    entries, message = BAD[name]
    with pytest.raises(PlantError) as refused:
        read(tmp_path, two(joint="range='-1 2' limited='true'"), **entries)
    assert str(refused.value).startswith(message)


FILES = {
    "no XML": ("arm", "not valid XML"),
    "empty": ("", "not valid XML"),
    "a URDF": (URDF, "no MJCF: it begins with <robot> (allowed: <mujoco>)"),
    "not MJCF": ("<mujoco><bodies/></mujoco>", "MuJoCo cannot read it: "),
    "NaN": (two(joint="damping='nan'"), "a number in it is NaN (allowed: finite numbers)"),
    "mass of a mesh after all": (
        two(
            within="<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><geom type='mesh' mesh='m'/>",
            after="<compiler inertiafromgeom='true'/><asset><mesh name='m' file='m.stl'/></asset>",
        ),
        "the mass of body 'fore' is that of the mesh m.stl, which cannot be loaded (allowed: a mesh that can",
    ),
    "too large a number": (
        two(joint="armature='1e7'"),
        "joint 'shoulder' has armature 1e+07 (allowed: numbers up to 1e+06)",
    ),
    "no UTF-8": (two().replace("fore", "for\udce2"), "not UTF-8"),
    "no inertia": (
        two(
            beside="<inertial pos='0 0 0' mass='1e-14' diaginertia='2e-15 2e-15 2e-15'/>",
            within="<inertial pos='0.2 0 0' mass='1e5' diaginertia='2e-15 2e-15 2e-15'/>",
        ),
        "MuJoCo cannot compute its motion: Inertia matrix is too close to singular",
    ),
    "too many joints": (
        "<mujoco><worldbody>" + 65 * "<body><joint/><geom size='.1'/>" + 65 * "</body>" + "</worldbody></mujoco>",
        "65 joints move (allowed: at most 64; or joints = [names]",
    ),
    "no joints": ("<mujoco/>", "no joint moves (allowed: hinges and slides in series)"),
    "impossible body": (
        two(within='<inertial pos="0 0 0" mass="-1" diaginertia="1 1 1"/>'),
        "MuJoCo cannot compile it: ",
    ),
    "mass of a mesh": (
        two(within="<geom type='mesh' mesh='m'/>", after="<asset><mesh name='m' file='m.stl'/></asset>"),
        "the mass of body 'fore' is that of the mesh m.stl, which cannot be loaded (allowed: a mesh that can",
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_file_that_does_not_compile_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """One line names the file, and what MuJoCo says of it, which leaves no log behind."""
    monkeypatch.chdir(tmp_path)
    text, message = FILES[name]
    path = tmp_path / "arm.xml"
    path.write_text(text, encoding="utf-8", errors="surrogateescape")
    with pytest.raises(PlantError) as refused:
        read_arm(ArmSettings(mjcf=str(path)), "arm.toml")
    assert message in str(refused.value)
    assert [each.name for each in tmp_path.iterdir()] == ["arm.xml"]


HINGE = '<body><joint axis="0 1 0"/><inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/></body>'
ABSURD = {
    "height field": '<asset><hfield name="h" nrow="30000" ncol="30000" size="1 1 1 1"/></asset>',
    "texture": '<asset><texture name="t" builtin="flat" width="60000" height="60000"/></asset>',
    "mesh": '<asset><mesh name="m" builtin="supersphere" params="100000 1 1"/></asset>',
    "replicate": '<worldbody><replicate count="100000000"><geom size="0.1"/></replicate></worldbody>',
    "replicate within replicate": (
        '<worldbody><replicate count="1000"><replicate count="1000"><site/></replicate></replicate></worldbody>'
    ),
    "replicate of many": f'<worldbody><replicate count="1000">{11 * "<site/>"}</replicate></worldbody>',
    "flex": '<worldbody><flexcomp name="f" type="grid" count="1000 1000 1000" spacing="1 1 1"/></worldbody>',
    "user data": '<size nuser_body="1000000000"/>',
    "keys": '<size nkey="100000000"/>',
    "sensor": '<sensor><user name="s" dim="1000000000"/></sensor>',
    "infinite": '<size nuserdata="inf"/>',
}


@pytest.mark.parametrize("name", ABSURD)
@pytest.mark.parametrize("is_included", [False, True])
def test_sizes_that_nobody_means_are_refused_before_they_are_allocated(
    tmp_path: Path, name: str, is_included: bool
) -> None:
    """A few letters would take many GB or many minutes, in the file or in one that it includes."""
    (tmp_path / "part.xml").write_text(f"<mujoco>{ABSURD[name]}</mujoco>")
    asked = '<include file="part.xml"/>' if is_included else ABSURD[name]
    path = tmp_path / "arm.xml"
    path.write_text(f"<mujoco><worldbody>{HINGE}</worldbody>{asked}</mujoco>")
    with pytest.raises(PlantError, match=r"allowed: up to (1 GB|10000)"):
        read_arm(ArmSettings(mjcf=str(path)), "arm.toml")


def test_sizes_that_somebody_means_are_allowed(tmp_path: Path) -> None:
    """A landscape, a texture, a wall of bricks."""
    field = '<hfield name="h" nrow="1000" ncol="1000" size="1 1 1 1"/>'
    texture = '<texture name="t" type="skybox" builtin="flat" width="512" height="3072"/>'
    wall = '<replicate count="20"><replicate count="20"><geom size="0.1" contype="0"/></replicate></replicate>'
    sizes = '<size njmax="5000" nconmax="5000" nkey="10" nuser_body="5"/>'
    path = tmp_path / "arm.xml"
    path.write_text(f"<mujoco>{sizes}<asset>{field}{texture}</asset><worldbody>{HINGE}{wall}</worldbody></mujoco>")
    assert read_arm(ArmSettings(mjcf=str(path)), "arm.toml").tree.njoint == 1
