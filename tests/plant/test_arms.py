"""Arms from their users' MJCF and URDF: the lean model moves as the whole file does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from arm_files import HOME, JOINTS, MJCF, URDF, read, two

from metaid.models.tree import Tree
from metaid.plant import ArmPlant, ArmSettings, ArmStart, load_chain
from metaid.plant.description import Arm, arm_model, build_arm_spec, build_spec, set_parameters, surfaces
from metaid.plant.description.reading import forces_of_lean, forces_of_whole


@pytest.fixture
def arm(tmp_path: Path) -> Arm:
    """Four joints in space."""
    return read(tmp_path, MJCF, joints=JOINTS, home=HOME)


@pytest.mark.parametrize("text", [MJCF, URDF])
def test_lean_model_moves_as_the_whole_file(tmp_path: Path, text: str) -> None:
    """Mass matrix, bias force and friction are those of the file, while its other joints are held."""
    arm = read(tmp_path, text, **({"joints": JOINTS, "home": HOME} if text == MJCF else {}))
    lean, random = arm_model(arm.tree, 0.002), np.random.default_rng(0)
    for _ in range(20):
        coordinates, speeds = random.uniform(-3.0, 3.0, (2, arm.tree.njoint))
        of_lean, of_whole = forces_of_lean(lean, coordinates, speeds), forces_of_whole(arm.whole, coordinates, speeds)
        for mine, theirs in zip(of_lean, of_whole, strict=True):
            assert np.abs(mine - theirs).max() <= 1e-9 * np.abs(theirs).max()
    assert lean.ngeom == 0


def test_tree_has_what_the_file_says_of_the_joints(arm: Arm) -> None:
    """Names, kinds, ranges, limits of the torque, rotors and friction, those of the actuators included."""
    tree = arm.tree
    assert tree.names == JOINTS
    assert tree.slides.tolist() == [False, False, True, False]
    assert tree.low.tolist() == [-2.0, -np.inf, -0.2, -np.inf]
    assert tree.high.tolist() == [1.5, np.inf, 0.3, np.inf]
    assert tree.torque_limit.tolist() == [50.0, 30.0, np.inf, np.inf]
    assert tree.rotor == pytest.approx([0.2 + 50**2 * 1e-4, 0.0, 0.0, 0.0])
    assert tree.damping == pytest.approx([50**2 * 1e-5, 0.3, 0.0, 0.0])
    assert tree.coulomb.tolist() == [0.0, 0.1, 0.0, 0.0]
    assert arm.home.tolist() == [0.0, 0.4, 0.1, 0.0]


def test_urdf_keeps_masses_without_its_meshes(tmp_path: Path) -> None:
    """Meshes in packages that are not there cost shapes alone, and a link without an inertial weighs nothing."""
    tree = read(tmp_path, URDF).tree
    assert tree.mass.tolist() == [2.0, 1.0]
    assert tree.torque_limit.tolist() == [40.0, np.inf]
    assert tree.low.tolist() == [-1.0, -np.inf]


def test_plant_file_says_what_the_arm_file_does_not(tmp_path: Path) -> None:
    """Rotors, friction, torque limits and gravity are those of the plant file where it has them."""
    said = {"rotor": {"elbow": 0.4}, "damping": {"shoulder": 0.7}, "frictionloss": {"elbow": 0.3}}
    tree = read(tmp_path, URDF, **said, torque_limit={"elbow": 9.0}, gravity=[0.0, 9.81, 0.0]).tree
    assert tree.rotor.tolist() == [0.0, 0.4]
    assert tree.damping.tolist() == [0.7, 0.0]
    assert tree.coulomb.tolist() == [0.2, 0.3]
    assert tree.torque_limit.tolist() == [40.0, 9.0]
    assert tree.gravity.tolist() == [0.0, 9.81, 0.0]


def _about_the_joints(tree: Tree) -> Tree:
    """The same joints with links whose centres of mass are on them, for which MuJoCo has short cuts."""
    return replace(
        tree,
        com=np.zeros_like(tree.com),
        inertia=np.broadcast_to(0.1 * np.eye(3), tree.inertia.shape),
        rotor=tree.rotor,
    )


def test_parameters_of_a_candidate_are_written_exactly(arm: Arm) -> None:
    """The forces are linear in the parameters, those of an impossible body included, whatever was compiled before."""
    tree, random = arm.tree, np.random.default_rng(0)
    model = build_arm_spec(_about_the_joints(tree), 0.002).compile()
    other = tree.with_parameters(tree.parameters * random.uniform(0.5, 1.5, tree.parameters.shape))
    beyond = tree.with_parameters(2.5 * tree.parameters - 1.5 * other.parameters)
    assert np.linalg.eigvalsh(beyond.inertia).min() < 0.0
    coordinates, speeds = random.uniform(-1.0, 1.0, (2, tree.njoint))
    forces = []
    for candidate in (tree, other, beyond):
        set_parameters(model, candidate)
        forces.append(forces_of_lean(model, coordinates, speeds)[:2])
    for of_tree, of_other, of_beyond in zip(*forces, strict=True):
        assert np.abs(2.5 * of_tree - 1.5 * of_other - of_beyond).max() < 1e-9 * np.abs(of_beyond).max()


SWING = """<mujoco><worldbody><body><joint name="swing" axis="0 1 0"/>
<inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.1"/></body></worldbody></mujoco>"""


def test_candidate_of_one_joint_may_hang_on_it_though_the_nominal_does_not(tmp_path: Path) -> None:
    """MuJoCo's short cuts for a body that is balanced on its joint are off."""
    tree = read(tmp_path, SWING).tree
    model = build_arm_spec(tree, 0.002).compile()
    set_parameters(model, replace(tree, com=np.array([[0.3, 0.0, 0.0]])))
    matrix, weight, _ = forces_of_lean(model, np.zeros(1), np.zeros(1))
    assert matrix[0, 0] == pytest.approx(0.1 + 2.0 * 0.3**2)
    assert weight[0] == pytest.approx(-2.0 * 9.81 * 0.3)


def test_flat_links_compile(tmp_path: Path) -> None:
    """The largest moment of inertia of a plate is the sum of the others, and in any frame off by rounding."""
    tree, random = read(tmp_path, SWING).tree, np.random.default_rng(0)
    for _ in range(20):
        axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
        plate = (axes * [0.1, 0.2, 0.3]) @ axes.T
        model = arm_model(replace(tree, inertia=plate[None]), 0.002)
        assert np.sort(model.body_inertia[1]) == pytest.approx([0.1, 0.2, 0.3])


def test_friction_acts_at_the_speed_that_a_step_begins_with(tmp_path: Path) -> None:
    """Viscous friction and dry friction, of a candidate whose nominal has none, too."""
    tree = replace(read(tmp_path, SWING).tree, gravity=np.zeros(3))
    model = build_arm_spec(tree, 0.01).compile()
    set_parameters(model, replace(tree, damping=np.array([2.0]), coulomb=np.array([0.5])))
    data = mujoco.MjData(model)
    data.qvel[:] = 3.0
    mujoco.mj_step(model, data)
    assert data.qvel[0] == pytest.approx(3.0 - 0.01 * (2.0 * 3.0 + 0.5) / 0.1, rel=1e-6)


def test_forces_that_a_file_switches_off_are_off(tmp_path: Path) -> None:
    """Gravity, viscous and dry friction, by the flags of its options."""
    flags = "<option><flag gravity='disable' damper='disable' frictionloss='disable'/></option>"
    tree = read(tmp_path, two(joint="damping='1' frictionloss='1'", after=flags)).tree
    assert not any([*tree.gravity, *tree.damping, *tree.coulomb])


def test_home_is_the_nearest_to_the_reference_pose_in_the_ranges(tmp_path: Path) -> None:
    """Where the plant file does not say it; or to the file's keyframe `home`."""
    joint = "range='0.2 2' limited='true'"
    assert read(tmp_path, two(joint=joint)).home.tolist() == [0.2, 0.0]
    keys = "<keyframe><key name='away' qpos='1 1'/><key name='home' qpos='3 0.7'/></keyframe>"
    assert read(tmp_path, two(joint=joint, after=keys)).home.tolist() == [2.0, 0.7]
    assert read(tmp_path, two(joint=joint, after=keys), home={"shoulder": 1.0}).home.tolist() == [1.0, 0.7]


def test_plant_coasts_under_its_own_bias_force(tmp_path: Path) -> None:
    """Under the torque that cancels the bias force and friction, joint speeds stay what they were."""
    (tmp_path / "arm.xml").write_text(URDF.replace('friction="0.2"', ""), encoding="utf-8")
    plant = ArmPlant("arm", ArmSettings(urdf=str(tmp_path / "arm.xml"), timestep=0.001))
    start = ArmStart(np.array([0.3, -0.4]), np.array([0.5, -1.0]))
    plant.push(start)
    for _ in range(100):
        pose, speeds = plant.states()
        _, bias, passive = forces_of_lean(plant.model, pose, speeds)
        plant.apply_torque(bias - passive)
        plant.step()
    pose, speeds = plant.states()
    assert speeds == pytest.approx(start.speeds, rel=1e-9)
    assert pose == pytest.approx(start.pose + 0.1 * start.speeds, rel=1e-9)
    plant.stop()
    assert not plant.data.qfrc_applied.any()
    assert plant.true_parameters() is not None
    assert ArmPlant("arm", plant.settings.model_copy(update={"truth_known": False})).true_parameters() is None


def test_plant_moves_as_the_springs_of_its_file_and_of_its_plant_file_let_it(tmp_path: Path) -> None:
    """Those that push away, too; what the plant file says goes before the other, and what is switched off is none."""
    springs = "stiffness='3' springref='0.5'"
    arm = read(tmp_path, two(joint=springs))
    assert (arm.stiffness.tolist(), arm.slack.tolist()) == ([3.0, 0.0], [0.5, 0.0])
    path, start = tmp_path / "arm.xml", ArmStart(np.array([0.3, -0.4]), np.array([0.5, -1.0]))
    path.write_text(two(joint="stiffness='-2' springref='0.1'"), encoding="utf-8")
    model = mujoco.MjModel.from_xml_path(str(path))
    for given, of_elbow in (({}, (0.0, 0.0)), ({"stiffness": {"elbow": 4.0}, "slack": {"elbow": -0.2}}, (4.0, -0.2))):
        plant = ArmPlant("arm", ArmSettings.model_validate({"mjcf": str(path), **given}))
        plant.push(start)
        plant.apply_torque(np.zeros(2))
        plant.step()
        model.jnt_stiffness[1], model.qpos_spring[1] = of_elbow
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = start.pose, start.speeds
        mujoco.mj_step(model, data)
        assert plant.states()[1] == pytest.approx(data.qvel, rel=1e-9)
        assert plant.hidden_forces["spring"].tolist() == [-2.0, of_elbow[0]]
        assert plant.hidden_forces["bias"] == pytest.approx([-0.2, of_elbow[0] * of_elbow[1]])
    off = read(tmp_path, two(joint=springs, after="<option><flag spring='disable'/></option>"))
    assert not off.stiffness.any()


def test_what_is_held_may_be_anything(tmp_path: Path) -> None:
    """A floating base, a branch, a spring and an activation state of joints that are not named concern nothing."""
    beside = "<body><joint name='hand' stiffness='3'/><geom size='0.1'/></body>"
    after = "<actuator><intvelocity joint='hand' kp='1' actrange='-1 1'/></actuator>"
    text = two(base="<joint name='b' type='ball'/>", beside=beside, after=after)
    arm = read(tmp_path, text, joints=["elbow"])
    assert arm.tree.names == ("elbow",)
    assert arm.tree.mass == pytest.approx(4.0 / 3.0 * np.pi * 0.1**3 * 1000.0)


def test_what_does_not_move_the_joints_may_be_there(tmp_path: Path) -> None:
    """Springs that are switched off, constraints and tendons within one link."""
    within = "<site name='one'/><site name='two' pos='0 0 0.1'/><body name='cover'><geom size='0.01'/></body>"
    bands = "<tendon><spatial stiffness='1'><site site='one'/><site site='two'/></spatial></tendon>"
    welds = "<equality><weld body1='fore' body2='cover'/><connect site1='one' site2='two'/></equality>"
    off = "<option><flag spring='disable'/></option>"
    arm = read(tmp_path, two(joint="stiffness='3'", within=within, after=bands + welds + off))
    assert arm.tree.names == ("shoulder", "elbow")


def test_torque_limit_is_the_least_that_is_said(tmp_path: Path) -> None:
    """Of controls, forces and joints; what a file has but switches off does not count."""
    motor = (
        "<motor joint='shoulder' gear='2' ctrlrange='-10 4' ctrllimited='true' forcerange='{}' forcelimited='true'/>"
    )
    limits = []
    for force, joint in (("-3 5", ""), ("-9 9", ""), ("-9 9", "-7 7' actuatorfrclimited='false"), ("-9 9", "-7 7")):
        said = f"actuatorfrcrange='{joint}'" if joint else ""
        text = two(joint=said, after=f"<actuator>{motor.format(force)}</actuator>")
        limits.append(read(tmp_path, text).tree.torque_limit[0])
    assert limits == [6.0, 8.0, 8.0, 7.0]


def test_surfaces_are_where_the_shapes_are(arm: Arm) -> None:
    """Of the base and of every link, at home: about their middles, and a ball at its radius."""
    shown = surfaces(arm.whole, arm.home)
    assert [surface.link for surface in shown] == [-1, 1, 1, 3, 3, 3]  # the link of the elbow has an inertial alone
    data = mujoco.MjData(arm.whole.model)
    data.qpos[:] = arm.whole.at(arm.home)
    mujoco.mj_kinematics(arm.whole.model, data)
    centres = [surface.triangles.reshape(-1, 3).mean(axis=0) for surface in shown]
    assert np.array(centres) == pytest.approx(data.geom_xpos[1:], abs=1e-6)
    ball = np.linalg.norm(shown[3].triangles - data.geom_xpos[4], axis=2)
    assert ball == pytest.approx(np.full(ball.shape, 0.05))


def test_mesh_of_a_group_that_weighs_nothing_may_be_missing(tmp_path: Path) -> None:
    """Masses follow from the shapes of the other groups."""
    mesh = "<compiler inertiagrouprange='0 2'/><asset><mesh name='m' file='m.stl'/></asset>"
    arm = read(tmp_path, two(within="<geom type='mesh' mesh='m' group='3'/>", after=mesh))
    assert arm.tree.mass == pytest.approx(read(tmp_path, two()).tree.mass)


def test_textures_that_are_not_there_cost_nothing(tmp_path: Path) -> None:
    """Neither do MuJoCo's warnings: they are not printed."""
    looks = "<asset><texture name='t' type='2d' file='no.png'/><material name='m' texture='t'/></asset>"
    text = two(within="<geom size='0.1' material='m'/>", after=looks + "<compiler settotalmass='3'/>")
    assert read(tmp_path, text).tree.mass.sum() < 3.0


def test_planar_chain_given_as_mjcf_moves_as_from_its_plant_file(tmp_path: Path) -> None:
    """Mass matrix and weight of the chain are those of the arm."""
    chain = load_chain("three-link")
    spec = build_spec(chain.chain, chain.gravity, chain.timestep)
    arm = read(tmp_path, spec.to_xml())
    lean, angles, speeds = arm_model(arm.tree, chain.timestep), np.array([0.3, -0.5, 0.9]), np.array([1.0, -2.0, 0.5])
    for mine, theirs in zip(
        forces_of_lean(lean, angles, speeds), forces_of_lean(chain.model, angles, speeds), strict=True
    ):
        assert mine == pytest.approx(theirs, rel=1e-9, abs=1e-12)


def test_mesh_of_a_package_is_found_in_a_folder_above(tmp_path: Path) -> None:
    """A mesh that is there is a shape of the arm, and none that is a body's mass."""
    (tmp_path / "nowhere").mkdir()
    (tmp_path / "robots").mkdir()
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    triangles = np.zeros(4, dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    triangles["corners"] = corners[[(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]]
    binary = bytes(80) + np.uint32(4).tobytes() + triangles.tobytes()
    (tmp_path / "nowhere" / "upper.stl").write_bytes(binary)
    arm = read(tmp_path / "robots", URDF)
    assert arm.whole.model.nmesh == 1
    assert arm.whole.lost_meshes == ("package://nowhere/base.stl",)
    assert arm.tree.mass.tolist() == [2.0, 1.0]
