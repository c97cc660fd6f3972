"""What the commands do with an arm: list, show, draw, and refuse in one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from conftest import Finished
from PIL import Image
from scipy.spatial.transform import Rotation

from metaid.exporting import mjcf
from metaid.files import shipped_names
from metaid.models.tree import PARAMETERS, planar_tree
from metaid.plant import ArmPlant, ArmStart, load_chain, load_plant
from metaid.plant.description.reading import forces_of_lean
from metaid.show.scene import in_viewer

Metaid = Callable[..., Finished]
ARMS = {"puma560": 6, "pa10": 7, "crs-a465": 6, "scara": 4, "spatial-three-link": 3, "horizontal-five-link": 5}
SWING = """<mujoco><worldbody><body pos="0 0 1"><joint name="swing" axis="0 1 0" range="-90 60" limited="true"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.03" mass="2"/></body></worldbody></mujoco>"""
FORK = """<mujoco><worldbody><body name="a"><joint name="a"/><geom size="0.1"/><body name="b"><joint name="b"/>
<geom size="0.1"/></body><body name="c"><joint name="c"/><geom size="0.1"/></body></body></worldbody></mujoco>"""
BARE = """<robot name="bare"><link name="base"/><link name="arm"><inertial><origin xyz="0 0 0.2"/><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="continuous">
<parent link="base"/><child link="arm"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/></joint></robot>"""


def write(name: str, plant: str, **files: str) -> None:
    """A plant file in the current folder, and files beside it."""
    Path(name).write_text(plant, encoding="utf-8")
    for file, text in files.items():
        Path(file.replace("_", ".")).write_text(text, encoding="utf-8")


@pytest.mark.parametrize("name", ARMS)
def test_shipped_arm_is_listed_with_its_joints_and_shown(metaid: Metaid, name: str) -> None:
    """With axes of length 1, limits, a home within them, and thirteen parameters a joint."""
    assert f"  {name} " in metaid("plant", "list").out
    shown = json.loads(metaid("plant", "show", name, "--json").out)
    assert (len(shown["joints"]), len(shown["links"])) == (ARMS[name], ARMS[name])
    for joint, link in zip(shown["joints"], shown["links"], strict=True):
        assert np.linalg.norm(joint["axis"]) == pytest.approx(1.0)
        assert joint["low"] <= joint["home"] <= joint["high"]
        assert joint["torque_limit"] > 0.0
        assert tuple(link) == PARAMETERS
        assert link["m"] > 0.0
    text = metaid("plant", "show", name).out
    assert all(joint["name"] in text for joint in shown["joints"])


def test_gravity_loads_the_slide_of_the_scara_alone() -> None:
    """Its hinges turn about the vertical."""
    plant = load_plant("scara")
    assert isinstance(plant, ArmPlant)
    tree = plant.tree
    assert tree.slides.tolist() == [False, False, True, False]
    turned = np.eye(3)
    for rotation, axis in zip(tree.rotation, tree.axis, strict=True):
        turned = turned @ rotation
        assert turned @ axis == pytest.approx([0.0, 0.0, 1.0])


def test_horizontal_five_link_is_the_five_link_on_its_side() -> None:
    """The mass matrix is that of the chain, but for the rotors, and no joint feels gravity."""
    arm, chain = load_plant("horizontal-five-link"), load_chain("five-link")
    assert isinstance(arm, ArmPlant)
    angles = np.array([0.3, -0.8, 1.1, 0.5, -0.9])
    matrix, weight, _ = forces_of_lean(arm.model, angles, np.zeros(5))
    assert matrix - np.diag(arm.tree.rotor) == pytest.approx(forces_of_lean(chain.model, angles, np.zeros(5))[0])
    assert weight == pytest.approx(np.zeros(5), abs=1e-12)


def test_weight_of_the_puma_is_what_its_reference_prints() -> None:
    """Gravity torque of the explicit model of Armstrong, Khatib and Burdick, with the constants that they print."""
    plant = load_plant("puma560")
    assert isinstance(plant, ArmPlant)
    g1, g2, g3, g4, g5 = -37.2, -8.44, 1.02, 0.249, -0.0282
    for pose in np.random.default_rng(0).uniform(-1.5, 1.5, (5, 6)):
        plant.push(ArmStart(pose, np.zeros(6)))
        mujoco.mj_forward(plant.model, plant.data)
        (s2, s4, s5), (c2, c4, c5) = np.sin(pose[[1, 3, 4]]), np.cos(pose[[1, 3, 4]])
        s23, c23 = np.sin(pose[1] + pose[2]), np.cos(pose[1] + pose[2])
        third = g2 * s23 + g4 * c23 + g5 * (s23 * c5 + c23 * c4 * s5)
        printed = [0.0, g1 * c2 + g3 * s2 + third, third, -g5 * s23 * s4 * s5, g5 * (c23 * s5 + s23 * c4 * c5), 0.0]
        assert plant.data.qfrc_bias == pytest.approx(printed, abs=0.05, rel=2e-3)
        assert plant.data.qfrc_bias[3:] == pytest.approx(printed[3:], abs=2e-4)


def test_arm_of_ones_own_is_found_beside_its_plant_file(metaid: Metaid) -> None:
    """What the file does not limit is null, and what the plant file says stands."""
    Path("own").mkdir()
    text = SWING.replace(' range="-90 60" limited="true"', "")
    write("own/swing.toml", 'mjcf = "swing.xml"\ngravity = [0, 0, 0]\n[rotor]\nswing = 0.5\n')
    Path("own/swing.xml").write_text(text, encoding="utf-8")
    shown = json.loads(metaid("plant", "show", "own/swing.toml", "--json").out)
    (joint,), (link,) = shown["joints"], shown["links"]
    assert (joint["low"], joint["high"], joint["torque_limit"]) == (None, None, None)
    assert (shown["gravity"], link["rotor"], link["m"]) == ([0.0, 0.0, 0.0], 0.5, 2.0)


def test_springs_of_an_arm_are_shown(metaid: Metaid) -> None:
    """Where they are, in their units; a joint without one is not named."""
    write("swing.toml", 'mjcf = "swing.xml"\nstiffness = { swing = 3.0 }\nslack = { swing = -0.2 }\n', swing_xml=SWING)
    (joint,) = json.loads(metaid("plant", "show", "swing.toml", "--json").out)["joints"]
    assert (joint["stiffness"], joint["slack"]) == (3.0, -0.2)
    assert "a spring in swing, 3 N m/rad, slack at -0.2 rad" in " ".join(
        metaid("plant", "show", "swing.toml").out.split()
    )
    assert "spring" not in metaid("plant", "show", "scara").out


@pytest.mark.parametrize("name", ["scara", "bare.toml"])
def test_arm_is_drawn_from_its_shapes_or_from_its_joints(metaid: Metaid, name: str) -> None:
    """A picture that is not blank, of a file without shapes, too."""
    write("bare.toml", 'urdf = "bare.urdf"', bare_urdf=BARE)
    assert metaid("plant", "draw", name, "-o", "arm.png").status == 0
    low, high = Image.open("arm.png").convert("L").getextrema()
    assert low < 60 < 240 < high


def test_mjcf_or_urdf_alone_is_a_plant(metaid: Metaid) -> None:
    """With all its joints, and what the file says of them."""
    write("bare.toml", 'urdf = "bare.urdf"', bare_urdf=BARE, swing_xml=SWING)
    shown, alone = (json.loads(metaid("plant", "show", name, "--json").out) for name in ("bare.toml", "bare.urdf"))
    assert shown == alone
    assert json.loads(metaid("plant", "show", "swing.xml", "--json").out)["joints"][0]["name"] == "swing"
    assert "no plant file at none.urdf" in metaid("plant", "show", "none.urdf").err


def test_viewer_shows_the_shapes_of_the_file_or_rods(metaid: Metaid) -> None:
    """In the model that MuJoCo's viewer moves."""
    write("bare.toml", 'urdf = "bare.urdf"', bare_urdf=BARE)
    for name, shapes in (("scara", 7), ("./bare.toml", 1)):
        assert in_viewer(load_plant(name))[0].ngeom == shapes


MISTAKES = {
    "no such file": ('mjcf = "none.xml"', "none.xml: No such file or directory"),
    "both kinds": ('mjcf = "swing.xml"\nurdf = "swing.xml"', "an arm is described by one file (allowed: mjcf or urdf)"),
    "the other kind": ('urdf = "swing.xml"', "swing.xml: no URDF: it begins with <mujoco> (allowed: <robot>)"),
    "no MJCF": ('mjcf = "arm.toml"', "arm.toml: not valid XML"),
    "unknown key": ('mjcf = "swing.xml"\njonts = ["swing"]', "unknown key 'jonts'; did you mean 'joints'?"),
    "unknown joint": (
        'mjcf = "swing.xml"\njoints = ["swng"]',
        "unknown joint 'swng'; did you mean 'swing'? (allowed: sw",
    ),
    "joint twice": ('mjcf = "swing.xml"\njoints = ["swing", "swing"]', "joints: 'swing' is named twice"),
    "too few numbers": ('mjcf = "swing.xml"\ngravity = [0, 0]', "gravity: entry 3: Field required"),
    "home beyond the range": (
        'mjcf = "swing.xml"\nhome = { swing = 2 }',
        "swing: 2 is beyond its range (allowed: -1.5708",
    ),
    "not serial": ('mjcf = "fork.xml"', "joints 'b' and 'c' are on different branches (allowed: joints in series"),
    "links and a file": ('mjcf = "swing.xml"\n[[links]]\nlength = 1\nmass = 1', "unknown key 'links'"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake_in_a_plant_file_is_answered_in_one_line(metaid: Metaid, mistake: str) -> None:
    """What is wrong, where, and what is allowed, with status 2; nothing is written."""
    text, message = MISTAKES[mistake]
    write("arm.toml", text, swing_xml=SWING, fork_xml=FORK)
    for arguments in (["plant", "show", "arm.toml"], ["plant", "draw", "arm.toml", "-o", "arm.png"]):
        answered = metaid(*arguments)
        assert answered.status == 2
        assert answered.err.count("\n") == 1
        assert message in answered.err
    assert not Path("arm.png").exists()


ELSEWHERE = {
    "study": (
        ["study", "create", "three-link", "--set", "plant=scara"],
        "plant scara is an arm, and the nominal model has the links of a planar chain (allowed: ",
    ),
    "nominal": (
        ["study", "create", "three-link", "--set", "nominal=scara"],
        "scara.toml: an arm, and not a planar chain",
    ),
    "viewer": (["plant", "view", "scara"], "there is no screen here"),
}


@pytest.mark.parametrize("command", ELSEWHERE)
def test_command_that_is_not_for_arms_says_so(metaid: Metaid, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    """In one line, with what is allowed instead."""
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    arguments, message = ELSEWHERE[command]
    answered = metaid(*arguments)
    assert answered.status == 2
    assert answered.err.count("\n") == 1
    assert message in answered.err


def test_every_shipped_plant_is_loaded() -> None:
    """Chains and arms alike."""
    arms = {name for name in shipped_names("plants") if isinstance(load_plant(name), ArmPlant)}
    assert arms == set(ARMS)


def test_chain_as_mjcf_has_the_lumps_of_its_plant_file(metaid: Metaid) -> None:
    """As the chain's own exporter writes it; and turned about the vertical, bent where its joints are 0, its links side
    by side.
    """
    told = json.loads(metaid("plant", "show", "damped-three-link", "--json").out)["lumps"]
    straight = planar_tree(load_chain("damped-three-link").chain, 9.81)
    ahead = Rotation.from_euler("ZY", [0.7, 0.4]).as_matrix(), Rotation.from_euler("y", -0.9).as_matrix(), np.eye(3)
    beside = straight.position + np.array([0.0, 0.05, 0.0])
    for tree in (straight, replace(straight, rotation=np.array(ahead), position=beside)):
        write("chain.toml", 'mjcf = "chain.xml"', chain_xml=mjcf(tree, "chain", 0.002, ["a chain"]))
        shown = json.loads(metaid("plant", "show", "chain.toml", "--json").out)["lumps"]
        assert [lump["name"] for lump in shown] == [lump["name"] for lump in told]
        assert [lump["true"] for lump in shown] == pytest.approx([lump["true"] for lump in told], rel=1e-9)
    assert "True lumps of a planar chain" in metaid("plant", "show", "chain.toml").out


def test_arm_that_is_no_planar_chain_has_no_lumps(metaid: Metaid) -> None:
    """Nor has a chain with rotors, or one whose joints gravity does not load."""
    for name in ("spatial-three-link", "horizontal-five-link", "scara"):
        assert "lumps" not in json.loads(metaid("plant", "show", name, "--json").out)
