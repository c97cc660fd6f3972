"""The files of an arm with the friction of real joints: each, loaded again, predicts what the formula says."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from conftest import random_plant
from exported import model_of
from random_arm import arm_named

from metaid.exporting import (
    ArmLaw,
    chain_dynamics,
    file_torques,
    mjcf,
    not_in_urdf,
    not_in_xml,
    urdf,
)
from metaid.models import Array
from metaid.models.tree import COLUMNS, JointFriction, Sliding, Tree, joint_mass_matrix, joint_torque

PUMA = arm_named("puma560")
COUPLED = ((1, 2), (4, 5))
needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")


def friction_of(tree: Tree, coupled: tuple[tuple[int, int], ...] = COUPLED) -> JointFriction:
    """All terms; two joints have no pre-sliding, two no spring, and one a spring that pushes away."""
    random, n, m = np.random.default_rng(0), tree.njoint, len(coupled)
    presliding = random.uniform(0.5e-3, 1e-3, n)
    presliding[[0, 3]] = 0.0
    viscous, coulomb, root, offset, load, still = random.uniform(0.1, 0.5, (6, n))
    rotor, viscous_2, coulomb_2, root_2 = random.uniform(0.1, 0.5, (4, m))
    spring = np.where(np.arange(n) % 3 == 1, 0.0, random.uniform(1.0, 5.0, n)) * np.where(np.arange(n) == 2, -1.0, 1.0)
    alone, none = {"offset": offset, "load": 0.1 * load, "spring": spring}, np.zeros(m)
    terms = {name: np.append(values, none) for name, values in alone.items()}
    terms["viscous"], terms["coulomb"] = np.append(viscous, viscous_2), np.append(coulomb, coulomb_2)
    terms["root"] = np.append(root, root_2)
    bent = np.where(np.arange(n) % 3 == 0, 0.2 * still, 0.0)
    return JointFriction(Sliding(presliding, 0.1 * still, bent, coupled), terms, rotor)


def without_presliding(friction: JointFriction) -> JointFriction:
    """The same whose dry friction follows the speed."""
    none = np.zeros(friction.sliding.njoint)
    return replace(friction, sliding=replace(friction.sliding, presliding=none))


def plain(friction: JointFriction) -> JointFriction:
    """What an MJCF can hold of it: constant torques beside springs alone."""
    terms = {name: friction.of(name) for name in ("viscous", "coulomb", "spring")}
    terms["offset"] = np.where(friction.of("spring") == 0.0, 0.0, friction.of("offset"))
    return replace(friction, terms=terms, sliding=Sliding.at_once(friction.sliding.still, friction.sliding.coupled))


def motion_of(njoint: int, nrow: int = 400, seconds: float = 4.0) -> tuple[Array, Array, Array]:
    """Joint coordinates, speeds and accelerations (nrow x njoint each) that turn back now and then."""
    times = np.linspace(0.0, seconds, nrow)[:, None]
    rates, phases = np.random.default_rng(1).uniform(1.0, 3.0, (2, njoint))
    across = rates * times + phases
    return 0.5 * np.sin(across), 0.5 * rates * np.cos(across), -0.5 * rates**2 * np.sin(across)


def formula(tree: Tree, friction: JointFriction, q: Array, v: Array, a: Array) -> Array:
    """The torques (nrow x njoint) written once more, row by row and joint by joint."""
    ideal = replace(tree, damping=np.zeros(tree.njoint), coulomb=np.zeros(tree.njoint))
    rigid = joint_torque(ideal, q, v, a)
    n, pairs, sliding = tree.njoint, friction.sliding.coupled, friction.sliding
    viscous, coulomb, root, offset, load, spring = (friction.of(term) for term in COLUMNS)
    torques = rigid + viscous[:n] * v + offset[:n] + spring[:n] * q
    each = sliding.presliding, sliding.still, sliding.bent
    columns = [(q[:, i], v[:, i], *(own[i] for own in each)) for i in range(n)]
    for i, j in pairs:
        columns.append((q[:, i] + q[:, j], v[:, i] + v[:, j], *((own[i] + own[j]) / 2.0 for own in each)))
    shares = []
    for place, speed, over, still, bent in columns:
        share = np.tanh(speed / bent) if bent else np.clip(speed / still, -1.0, 1.0)
        if over:
            share[0] = 0.0
            for row in range(1, len(place)):
                moved = place[row] - place[row - 1]
                end = np.sign(moved)
                share[row] = end + (share[row - 1] - end) * np.exp(-abs(moved) / over)
        shares.append(share)
    for i in range(n):
        dry = coulomb[i] + root[i] * np.sqrt(np.abs(v[:, i])) + load[i] * np.abs(rigid[:, i])
        torques[:, i] += shares[i] * dry
    for couple, (i, j) in enumerate(pairs):
        speed = v[:, i] + v[:, j]
        dry = coulomb[n + couple] + root[n + couple] * np.sqrt(np.abs(speed))
        both = friction.coupled_rotor[couple] * (a[:, i] + a[:, j]) + viscous[n + couple] * speed
        torques[:, [i, j]] += (both + shares[n + couple] * dry)[:, None]
    return np.asarray(torques, dtype=np.float64)


def written(folder: Path, law: ArmLaw) -> tuple[Path, Path]:
    """The law in Python and in C, called `arm`."""
    (folder / "arm.py").write_text(law.python(), encoding="utf-8")
    (folder / "arm.h").write_text(law.c("arm"), encoding="utf-8")
    return folder / "arm.py", folder / "arm.h"


NO_COUPLES: tuple[tuple[int, int], ...] = ()
FRICTIONS = {
    "everything": friction_of(PUMA),
    "nothing coupled": friction_of(PUMA, NO_COUPLES),
    "no pre-sliding": without_presliding(friction_of(PUMA)),
    "viscous and dry": plain(friction_of(PUMA, NO_COUPLES)),
}


@pytest.mark.parametrize("what", FRICTIONS)
def test_law_predicts_what_the_formula_says(tmp_path: Path, what: str) -> None:
    """As an object, in Python and, where there is a compiler, in C."""
    friction, motion = FRICTIONS[what], motion_of(6)
    law = ArmLaw(PUMA, PUMA.parameters, friction)
    wanted = formula(PUMA, friction, *motion)
    np.testing.assert_allclose(law.inverse_dynamics(*motion), wanted, atol=1e-10)
    for path in written(tmp_path, law):
        found = file_torques(path, "arm", *motion, PUMA.names)
        if found.torques is not None:
            np.testing.assert_allclose(found.torques, wanted, atol=1e-10, err_msg=path.name)
        else:
            assert path.suffix == ".h"
            assert "no C compiler" in found.why_not


@needs_compiler
@pytest.mark.parametrize("what", FRICTIONS)
def test_law_in_c_has_no_warning(tmp_path: Path, what: str) -> None:
    """Of a strict C99 compiler, whatever is left out."""
    written(tmp_path, ArmLaw(PUMA, PUMA.parameters, FRICTIONS[what]))
    (tmp_path / "main.c").write_text('#include "arm.h"\nint main(void) { return 0; }\n', encoding="utf-8")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run(["cc", *flags, "main.c", "-o", "main", "-lm"], cwd=tmp_path, check=True)


def test_one_state_has_the_dry_friction_of_its_speed_or_of_the_slip_that_it_is_given() -> None:
    """`torque` leaves nothing to accelerate; `slide` is what rows do by themselves."""
    law = ArmLaw(PUMA, PUMA.parameters, FRICTIONS["everything"])
    names: dict[str, object] = {}
    exec(law.python(), names)
    torque, inverse, slide, matrix = (names[key] for key in ("torque", "inverse_dynamics", "slide", "mass_matrix"))
    assert callable(torque)
    assert callable(inverse)
    assert callable(slide)
    assert callable(matrix)
    q, v, a = (each[7] for each in motion_of(6))
    np.testing.assert_allclose(torque(q, v), law.torque(q, v), atol=1e-10)
    np.testing.assert_allclose(inverse(q, v, a), law.inverse_dynamics(q, v, a), atol=1e-10)
    np.testing.assert_allclose(matrix(q), law.mass_matrix(q), atol=1e-10)
    slip, rows = None, [each[:20] for each in motion_of(6)]
    one_by_one = []
    for row, state in enumerate(zip(*rows, strict=True)):
        slip = slide(slip, rows[0][row] - rows[0][max(row - 1, 0)])
        one_by_one.append(inverse(*state, slip))
    np.testing.assert_allclose(one_by_one, law.inverse_dynamics(*rows), atol=1e-10)


def test_law_takes_one_state_or_many() -> None:
    """Torque, mass matrix, and inverse dynamics of motions side by side."""
    law, motion = ArmLaw(PUMA, PUMA.parameters, FRICTIONS["everything"]), motion_of(6, 8)
    q, v, _ = motion
    np.testing.assert_allclose(law.torque(q, v)[3], law.torque(q[3], v[3]), atol=1e-10)
    np.testing.assert_allclose(law.mass_matrix(q)[3], law.mass_matrix(q[3]), atol=1e-10)
    coupled = law.mass_matrix(q[0]) - joint_mass_matrix(PUMA, q[0])
    assert coupled[1, 2] == pytest.approx(FRICTIONS["everything"].coupled_rotor[0])
    together = law.inverse_dynamics(*(np.stack([each, each[::-1]]) for each in motion))
    np.testing.assert_allclose(together[1], law.inverse_dynamics(*(each[::-1] for each in motion)), atol=1e-10)


def test_pre_sliding_follows_the_motion_and_not_the_speed() -> None:
    """Dry friction turns some time after the joint has turned back, and rests where the joint does."""
    one = JointFriction.simple(np.zeros(1), np.ones(1), np.full(1, 0.01))
    sliding = replace(one.sliding, presliding=np.full(1, 1e-3))
    q = np.concatenate([np.linspace(0.0, 0.1, 50), np.full(5, 0.1), 0.1 - np.linspace(0.0, 2e-3, 20)])[:, None]
    slip = sliding.along(q, np.zeros_like(q))[:, 0]
    assert slip[0] == 0.0
    np.testing.assert_allclose(slip[49:55], 1.0, atol=1e-9)
    np.testing.assert_allclose(slip[-1], -1.0 + 2.0 * np.exp(-2.0), atol=1e-9)


def test_simple_file_says_nothing_of_what_it_has_not() -> None:
    """A study's arm has viscous and dry friction alone."""
    law = ArmLaw(PUMA, PUMA.parameters, JointFriction.simple(PUMA.damping, PUMA.coulomb, np.full(6, 0.1)))
    for text in (law.python(), law.c("arm")):
        words = ("slip", "slide(", "root", "offset[", "OFFSET", "load[N]", "LOAD", "spring", "SPRING", "coupled", "%")
        assert not [word for word in words if word in text]


def test_mjcf_with_coupled_joints_and_springs_predicts_what_the_formula_says(tmp_path: Path) -> None:
    """MuJoCo's own inverse dynamics, at speeds where its dry friction is whole."""
    friction = plain(FRICTIONS["everything"])
    tree = replace(PUMA, damping=friction.of("viscous")[:6], coulomb=friction.of("coulomb")[:6])
    path = tmp_path / "arm.xml"
    path.write_text(mjcf(tree, "arm", 0.002, ["an arm"], friction), encoding="utf-8")
    random = np.random.default_rng(2)
    q, a = random.uniform(-0.5, 0.5, (2, 30, 6))
    v = random.uniform(0.5, 1.0, (30, 6)) * random.choice([-1.0, 1.0], (30, 1))
    found = file_torques(path, "arm", q, v, a, tree.names).torques
    np.testing.assert_allclose(found, formula(tree, friction, q, v, a), atol=1e-8)
    reversed_order = file_torques(path, "arm", *(each[:, ::-1] for each in (q, v, a)), tree.names[::-1]).torques
    assert reversed_order is not None
    np.testing.assert_array_equal(reversed_order[:, ::-1], found)


def test_urdf_predicts_the_same_without_rotors_in_the_gravity_that_it_is_given(tmp_path: Path) -> None:
    """It says what it lacks. Without rotors wrists are so light that dry friction is soft: they have little."""
    friction, coulomb = FRICTIONS["everything"], np.array([0.3, 0.4, 0.3, 0.1, 0.01, 0.01])
    viscous_and_dry = JointFriction.simple(friction.of("viscous")[:6], coulomb, friction.sliding.still)
    tree = replace(PUMA, damping=friction.of("viscous")[:6], coulomb=coulomb, gravity=np.array([0.0, 9.81, 0.0]))
    path = tmp_path / "arm.urdf"
    path.write_text(urdf(tree, "arm", not_in_urdf(tree, friction)), encoding="utf-8")
    random = np.random.default_rng(2)
    q, v, a = random.uniform(0.3, 0.8, (3, 30, 6))
    found = file_torques(path, "arm", q, v, a, tree.names, tree.gravity).torques
    without = replace(tree, rotor=np.zeros(6))
    np.testing.assert_allclose(found, formula(without, viscous_and_dry, q, v, a), atol=1e-8)
    text = path.read_text(encoding="utf-8")
    assert f"turns with the sum of {tree.names[1]} and {tree.names[2]}" in text
    assert "gravity; it is 0.0 9.81 0.0" in text


def test_what_no_xml_can_hold_is_said() -> None:
    """Each term that is there, in a sentence; nothing of simple friction."""
    assert len(not_in_xml(FRICTIONS["everything"])) == 5
    assert not_in_xml(plain(FRICTIONS["everything"])) == []


def test_files_of_a_chain_predict_alike(tmp_path: Path) -> None:
    """Plant file, MJCF, Python and C; JSON moves nothing."""
    chain = random_plant(3).chain
    lumps = chain.lumps_of(("gravity", "coriolis", "inertia", "damping", "coulomb"))
    count = len(chain.lumps_of(("gravity", "coriolis", "inertia")).vector)
    dynamics = chain_dynamics(lumps, 9.81, chain, np.ones(count, dtype=np.bool_))
    model = model_of(dynamics, "chain")
    motion = motion_of(3)
    wanted = dynamics.law.inverse_dynamics(*motion)
    assert wanted is not None
    for suffix in (".toml", ".xml", ".py", ".h", ".json"):
        model.write(tmp_path / f"model{suffix}")
        found = file_torques(tmp_path / f"model{suffix}", "chain", *motion, model.tree.names)
        if suffix == ".json":
            assert found.torques is None
            assert "nothing that moves" in found.why_not
        elif found.torques is not None or suffix != ".h":
            np.testing.assert_allclose(found.torques, wanted, atol=1e-8, err_msg=suffix)


def test_friction_of_mujoco_is_late_where_a_joint_turns_back(tmp_path: Path) -> None:
    """Its sign is that of q̈ + b q̇, with the largest b that the timestep allows, 1/dt of MuJoCo's dmax."""
    tree = replace(arm_named("one"), coulomb=np.array([0.3]), damping=np.zeros(1))
    path = tmp_path / "arm.xml"
    path.write_text(mjcf(tree, "arm", 0.002, ["an arm"]), encoding="utf-8")
    model = mujoco.MjModel.from_xml_path(str(path))
    rate = 2.0 / (model.dof_solimp[0, 1] * model.dof_solref[0, 0])
    assert rate == pytest.approx(1.0 / (0.002 * 0.99))
    v, a = np.array([[0.5], [0.005]]), np.array([[-5.0], [-5.0]])
    found = file_torques(path, "arm", np.zeros((2, 1)), v, a, tree.names).torques
    dry = found - joint_torque(replace(tree, coulomb=np.zeros(1)), np.zeros((2, 1)), v, a)
    np.testing.assert_allclose(dry[:, 0], 0.3 * np.sign(a + rate * v)[:, 0], atol=1e-9)
