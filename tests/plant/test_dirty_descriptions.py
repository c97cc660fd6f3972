"""Files of robots as people have them: inertias of no body, branches, fingers that follow, leftovers of xacro."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from arm_files import MJCF, read
from conftest import Finished
from swinging import log_of

from metaid.errors import PlantError
from metaid.plant import load_plant

INERTIA = '<inertia ixx="{0}" iyy="{1}" izz="{2}" ixy="0" ixz="0" iyz="0"/>'
GOOD = (0.02, 0.03, 0.025)
ROBOT = """
<robot name="dirty">
  <link name="base"/>
  <link name="antenna"><inertial><mass value="0.1"/>{antenna}</inertial>
    <visual><geometry><mesh filename="package://nowhere/antenna.dae"/></geometry></visual></link>
  <link name="upper"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>{upper}</inertial></link>
  <link name="fore"><inertial><origin xyz="0 0.1 0"/><mass value="1"/>{fore}</inertial></link>
  <link name="left"><inertial><mass value="0.05"/>{left}</inertial></link>
  <link name="right"><inertial><mass value="0.05"/>{left}</inertial></link>
  <joint name="mast" type="fixed"><parent link="base"/><child link="antenna"/></joint>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0.3 0 0"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="left" type="prismatic"><parent link="fore"/><child link="left"/><origin xyz="0 0.2 0"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
  <joint name="right" type="prismatic"><parent link="fore"/><child link="right"/><origin xyz="0 0.2 0"/>
    <axis xyz="-1 0 0"/><limit lower="0" upper="0.1" effort="1" velocity="1"/><mimic joint="left"/></joint>
</robot>
"""
ARM = ["shoulder", "elbow"]


def robot(**inertias: tuple[float, float, float]) -> str:
    """The robot with these inertias, and possible ones of the other links."""
    usual = dict.fromkeys(("antenna", "upper", "fore", "left"), GOOD)
    return ROBOT.format(**{link: INERTIA.format(*moments) for link, moments in (usual | inertias).items()})


def test_what_hangs_on_the_base_may_be_impossible(tmp_path: Path) -> None:
    """An antenna with a negative inertia does not matter: the arm is the same, and nothing is said."""
    dirty = read(tmp_path, robot(antenna=(-0.001, 0.002, 0.002)), joints=ARM)
    np.testing.assert_array_equal(dirty.tree.parameters, read(tmp_path, robot(), joints=ARM).tree.parameters)
    assert dirty.repairs == ()


def test_an_impossible_inertia_of_a_moving_link_is_repaired_and_said(tmp_path: Path) -> None:
    """Its second moments become the nearest that are not negative, and those of other links stay."""
    dirty, clean = (read(tmp_path, robot(**each), joints=ARM) for each in ({"upper": (0.02, 0.03, 0.09)}, {}))
    assert [text.partition(":")[0] for text in dirty.repairs] == ["arm.xml"]
    assert "'upper' (principal moments 0.02 0.03 0.09 kg m²)" in dirty.repairs[0]
    first, second, third = np.linalg.eigvalsh(dirty.tree.inertia[0])
    assert third < first + second
    np.testing.assert_allclose([first, second, third], [0.04, 0.05, 0.09], rtol=0.02)
    np.testing.assert_array_equal(dirty.tree.mass, clean.tree.mass)
    np.testing.assert_array_equal(dirty.tree.inertia[1], clean.tree.inertia[1])


def test_a_link_on_the_way_is_said_only_where_a_joint_that_was_asked_for_moves_it(tmp_path: Path) -> None:
    """Where the elbow alone moves, the upper arm is part of the base."""
    text = robot(upper=(0.02, 0.03, 0.09))
    assert read(tmp_path, text, joints=["elbow"]).repairs == ()
    assert len(read(tmp_path, text, joints=ARM).repairs) == 1


def test_a_link_without_inertia_gets_that_of_a_ball(tmp_path: Path) -> None:
    """A mass without an extent, as of a flange, turns as a ball of aluminium does."""
    text = robot(left=(0.0, 0.0, 0.0)).replace('<mimic joint="left"/>', "")
    arm = read(tmp_path, text, joints=[*ARM, "left"])
    radius = (3 * 0.05 / (4 * np.pi * 2700)) ** (1 / 3)
    np.testing.assert_allclose(np.diag(arm.tree.inertia[2]), 0.4 * 0.05 * radius**2, rtol=1e-9)
    assert "arm.xml: 'left' has no inertia: that of a ball of 0.05 kg is taken" in arm.repairs


def test_a_link_that_weighs_nothing_may_be_on_the_way_but_not_last(tmp_path: Path) -> None:
    """A frame between two joints needs no mass; a joint that moves nothing cannot be identified."""
    text = robot().replace('<mass value="2"/>' + INERTIA.format(*GOOD), '<mass value="0"/>' + INERTIA.format(0, 0, 0))
    arm = read(tmp_path, text, joints=ARM)
    assert arm.tree.mass[0] < 1e-6 < arm.tree.mass[1]
    assert arm.repairs == ("arm.xml: 'upper' weighs nothing",)
    for mass in ("1", "0.05"):
        text = text.replace(f'<mass value="{mass}"/>', '<mass value="0"/>')
    with pytest.raises(PlantError, match="nothing that joint 'elbow' moves weighs anything"):
        read(tmp_path, text, joints=ARM)


def test_fingers_that_follow_others_are_held(tmp_path: Path) -> None:
    """A joint that mimics another is in nobody's way, and cannot be asked for with it."""
    tree = read(tmp_path, robot(), joints=ARM).tree
    assert tree.mass[1] == pytest.approx(1.1)
    with pytest.raises(PlantError, match="couples joint 'left'"):
        read(tmp_path, robot(), joints=["shoulder", "elbow", "left"])


def test_link_that_stands_for_a_frame_is_repaired_in_silence(tmp_path: Path) -> None:
    """As those of a Sawyer, whose masses, moments and products are all 1e-8."""
    frame = '<link name="frame"><inertial><mass value="1e-8"/>' + INERTIA.format(1e-8, 1e-8, 1e-8)
    frame = frame.replace('xy="0"', 'xy="1e-8"').replace('xz="0"', 'xz="1e-8"').replace('yz="0"', 'yz="1e-8"')
    fixed = '<joint name="flange" type="fixed"><parent link="fore"/><child link="frame"/></joint></robot>'
    arm = read(tmp_path, robot().replace("</robot>", f"{frame}</inertial></link>{fixed}"), joints=ARM)
    assert arm.repairs == ()


def test_joints_on_short_branches_are_held_and_named(tmp_path: Path) -> None:
    """As fingers are, where nobody says which joints move; not beside a floating base, which could not be held."""
    arm = read(tmp_path, robot())
    assert arm.tree.names == ("shoulder", "elbow")
    assert arm.repairs == ("arm.xml: held, for they are on branches: left, right (--joints A,B of those that move)",)
    assert read(tmp_path, robot(), joints=ARM).repairs == ()
    with pytest.raises(PlantError, match="joint 'free' is a floating base"):
        read(tmp_path, MJCF.replace('<geom type="box" size="0.1', '<freejoint name="free"/><geom type="box" size="0.1'))


def test_an_mjcf_is_repaired_as_a_urdf_is(tmp_path: Path) -> None:
    """Diagonal inertias, too."""
    text = """<mujoco><worldbody><body name="arm"><joint name="j" axis="0 1 0"/>
      <inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.02 0.05"/></body></worldbody></mujoco>"""
    arm = read(tmp_path, text)
    np.testing.assert_allclose(np.linalg.eigvalsh(arm.tree.inertia[0]), [0.02, 0.03, 0.05], rtol=0.03)
    assert "'arm' (principal moments 0.01 0.02 0.05 kg m²)" in arm.repairs[0]


def test_of_what_stands_twice_in_a_urdf_the_first_counts_and_it_is_said(tmp_path: Path) -> None:
    """As for ROS; shapes may be several."""
    shape = "<collision><geometry><sphere radius='0.01'/></geometry></collision>"
    clean = robot().replace('<link name="base"/>', f'<link name="base">{2 * shape}</link>')
    origin = '<origin xyz="0.3 0 0"/>'
    text = clean.replace(origin, origin + '<origin xyz="7 0 0"/>').replace('<mass value="1"/>', 2 * '<mass value="1"/>')
    assert text.count("origin") == clean.count("origin") + 1
    dirty = read(tmp_path, text, joints=ARM)
    assert dirty.repairs == (
        "arm.xml: link 'fore', inertial: <mass> stands there 2 times: the first is taken",
        "arm.xml: joint 'elbow': <origin> stands there 2 times: the first is taken",
    )
    np.testing.assert_array_equal(dirty.tree.position, read(tmp_path, clean, joints=ARM).tree.position)


def test_what_drake_reads_is_read(tmp_path: Path) -> None:
    """A namespace of its own, a `world` that is not declared, and one that is, whose inertia is no body's."""
    clean = read(tmp_path, robot(), joints=ARM).tree
    weld = '<joint name="weld" type="fixed"><parent link="world"/><child link="base"/></joint>'
    world = f'<link name="world"><inertial><mass value="1"/>{INERTIA.format(0.01, 0.0, 0.0)}</inertial></link>'
    own = '<robot xmlns="https://drake.mit.edu" name="dirty">'
    for text in (weld, world + weld):
        arm = read(tmp_path, robot().replace('<robot name="dirty">', own + text), joints=ARM)
        assert arm.repairs == ()
        np.testing.assert_allclose(arm.tree.parameters, clean.parameters, atol=1e-12)


def test_a_link_on_which_a_joint_hangs_and_that_is_not_there_is_said(tmp_path: Path) -> None:
    """It is taken for the base."""
    arm = read(
        tmp_path,
        robot().replace('<parent link="base"/><child link="upper"/>', '<parent link="stand"/><child link="upper"/>'),
        joints=ARM,
    )
    assert arm.repairs == ("arm.xml: link 'stand', on which a joint hangs, is not there: an empty one is taken",)


@pytest.mark.parametrize("key", ["damping", "friction"])
def test_friction_that_drives_is_none_and_it_is_said(tmp_path: Path, key: str) -> None:
    """Least squares often find some, which people then write into their URDF."""
    text = robot().replace('<axis xyz="0 1 0"/>', f'<axis xyz="0 1 0"/><dynamics {key}="-0.4"/>')
    arm = read(tmp_path, text, joints=ARM)
    (said,) = arm.repairs
    assert said.startswith("arm.xml: joint 'shoulder' has")
    assert said.endswith("-0.4, which no joint has: 0 is taken")
    assert not arm.tree.damping.any()
    assert not arm.tree.coulomb.any()


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("arm.urdf", '<link name="${prefix}tip"/>', r"'\$\{prefix\}tip' is in <link> \(allowed: what xacro makes"),
        ("arm.urdf", '<xacro:arm name="one"/>', r"<xacro:arm> is in it \(allowed: what xacro makes"),
        ("arm.urdf.xacro", "", r"it ends with .xacro \(allowed: .* xacro arm.urdf.xacro > robot.urdf\)"),
    ],
)
def test_what_xacro_has_not_expanded_is_refused_by_name(tmp_path: Path, name: str, text: str, message: str) -> None:
    """One line says what is left, and the command that expands it."""
    head = '<robot name="dirty" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="pi" value="3"/>'
    (tmp_path / name).write_text(robot().replace('<robot name="dirty">', head + text), encoding="utf-8")
    with pytest.raises(PlantError, match=message):
        load_plant(tmp_path / name, ARM)


def test_joints_are_asked_for_without_a_plant_file(tmp_path: Path) -> None:
    """What xacro leaves behind does not matter."""
    path = tmp_path / "arm.urdf"
    head = '<robot name="dirty" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="pi" value="3"/>'
    path.write_text(robot().replace('<robot name="dirty">', head), encoding="utf-8")
    assert load_plant(path, ARM).njoint == 2
    with pytest.raises(PlantError, match="joints: all of it move"):
        load_plant("two-link", ARM)


def test_repair_is_a_line_on_stderr_and_stands_in_the_json(metaid: Callable[..., Finished], tmp_path: Path) -> None:
    """What was mended is said wherever the robot is shown."""
    path = tmp_path / "arm.urdf"
    path.write_text(robot(fore=(0.01, 0.01, 0.05)), encoding="utf-8")
    done = metaid("plant", "show", str(path), "--joints", "shoulder,elbow", "--json")
    assert (done.status, done.err.count("\n")) == (0, 1)
    assert done.err.startswith("warning: arm.urdf: no body has the inertia of 'fore'")
    (said,) = json.loads(done.out)["repairs"]
    assert done.err == f"warning: {said}\n"


@pytest.mark.slow
def test_log_is_estimated_with_the_joints_that_are_asked_for(metaid: Callable[..., Finished], tmp_path: Path) -> None:
    """The whole robot's file is the nominal one; what was mended in it stands in the result."""
    path = tmp_path / "arm.urdf"
    path.write_text(robot(antenna=(-1.0, 1.0, 1.0), fore=(0.01, 0.01, 0.05)), encoding="utf-8")
    record = log_of(read(tmp_path, robot(), joints=ARM).tree, noise=1e-5, seconds=6.0)
    columns = {"time": record.times}
    for kind, values in (("angle", record.angles), ("torque", record.torques)):
        columns |= {f"{kind}_{joint + 1}": values[:, joint] for joint in range(record.njoint)}
    pd.DataFrame(columns).to_csv("log.csv", index=False)
    options = ("--joints", "shoulder,elbow", "--friction", "viscous,coulomb", "--window", "0.2", "--json")
    done = metaid("estimate", "log.csv", "--nominal", str(path), *options)
    shown = json.loads(done.out)
    assert (done.status, shown["verdict"], done.err.count("\n")) == (0, "found", 1)
    assert [text.partition(" (")[0] for text in shown["nominal_repairs"]] == [
        "arm.urdf: no body has the inertia of 'fore'"
    ]
    assert [row["name"] for row in shown["held_out"]["torque"]["joints"]] == ARM
