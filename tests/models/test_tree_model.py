"""The torque of an arm, what of it is told by base parameters, and what is believed of the rest."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from conftest import random_plant
from random_arm import random_arm

from metaid.models import Array, ChainModel
from metaid.models.tree import (
    ArmPrior,
    PriorDeviations,
    Tree,
    base_parameters,
    joint_mass_matrix,
    joint_torque,
    kinetic_squares,
    model_error,
    planar_chain,
    planar_tree,
    random_states,
    seen_by_bias,
    torque_regressor,
)
from metaid.plant.description import arm_model

ARMS = [(4, ()), (5, (1, 3)), (3, (0,)), (1, ())]


def mujocos(tree: Tree, coordinates: Array, speeds: Array, accelerations: Array) -> tuple[Array, Array]:
    """What MuJoCo says of the torque (njoint) and the mass matrix (njoint x njoint) of an arm without dry friction."""
    model = arm_model(tree, 0.002)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = coordinates, speeds, accelerations
    mujoco.mj_inverse(model, data)
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    return data.qfrc_inverse.copy(), matrix


@pytest.mark.parametrize(("njoint", "slides"), ARMS)
def test_turned_arm_at_what_encoders_read_is_the_arm_at_the_truth(njoint: int, slides: tuple[int, ...]) -> None:
    tree = random_arm(njoint, 3, slides)
    q, v, a = np.random.default_rng(4).uniform(-2.0, 2.0, (3, 10, njoint))
    zeros = np.random.default_rng(5).uniform(-1.0, 1.0, njoint)
    np.testing.assert_allclose(
        joint_torque(tree.turned(zeros), q - zeros, v, a), joint_torque(tree, q, v, a), rtol=1e-9
    )


@pytest.mark.parametrize(("njoint", "slides"), ARMS)
def test_torque_and_mass_matrix_are_those_of_mujoco(njoint: int, slides: tuple[int, ...]) -> None:
    """With hinges and slides along any axes, rotors and viscous friction."""
    tree = replace(random_arm(njoint, 1, slides), coulomb=np.zeros(njoint))
    state = np.random.default_rng(2).standard_normal((3, njoint))
    torque, matrix = mujocos(tree, *state)
    np.testing.assert_allclose(joint_torque(tree, *state), torque, atol=1e-12 * np.abs(torque).max())
    np.testing.assert_allclose(joint_mass_matrix(tree, state[0]), matrix, atol=1e-12 * np.abs(matrix).max())
    np.testing.assert_allclose(kinetic_squares(tree, *state[:2]), state[1] @ matrix @ state[1], rtol=1e-12)


def test_dry_friction_is_felt_in_full_by_a_joint_that_turns() -> None:
    """A joint faster than 0.1 rad/s feels all of it, a slower one its share."""
    tree = random_arm(3, 4)
    speeds = np.array([1.0, -0.2, 0.05])
    rest = replace(tree, coulomb=np.zeros(3))
    felt = joint_torque(tree, np.zeros(3), speeds, np.zeros(3)) - joint_torque(rest, np.zeros(3), speeds, np.zeros(3))
    np.testing.assert_allclose(felt, tree.coulomb * [1.0, -1.0, 0.5])


@pytest.mark.robots
def test_regressor_of_pinocchio_is_the_same() -> None:
    """Its ten parameters of a link are these ten."""
    pinocchio = pytest.importorskip("pinocchio", reason="`make robots` installs pinocchio")
    tree = random_arm(4, 3, friction=False)
    model = pinocchio.Model()
    model.gravity.linear = tree.gravity
    joint = 0
    for i in range(tree.njoint):
        where = pinocchio.SE3(tree.rotation[i], tree.position[i])
        joint = model.addJoint(joint, pinocchio.JointModelRevoluteUnaligned(tree.axis[i]), where, tree.names[i])
    state = np.random.default_rng(2).standard_normal((3, tree.njoint))
    theirs = pinocchio.computeJointTorqueRegressor(model, model.createData(), *state).reshape(4, 4, 10)
    order = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]  # there the moments come column by column
    np.testing.assert_allclose(torque_regressor(tree, *state)[..., :10], theirs[..., order], atol=1e-12)


@pytest.mark.parametrize(("njoint", "slides"), ARMS)
def test_base_parameters_tell_the_torque_and_no_fewer_would(njoint: int, slides: tuple[int, ...]) -> None:
    """Columns of the base parameters times their values are the torque, and these columns are independent."""
    tree = random_arm(njoint, 5, slides)
    base = base_parameters(tree)
    states = random_states(tree, 7, 40)
    rows = torque_regressor(tree, *states).reshape(40 * njoint, -1)[:, base.columns]
    torque = joint_torque(tree, *states).ravel()
    np.testing.assert_allclose(rows @ base.of(tree.parameters), torque, atol=1e-9 * np.abs(torque).max())
    assert np.linalg.matrix_rank(rows) == len(base.names)


def test_which_parameters_count_is_no_matter_of_rounding() -> None:
    """Of columns that are equal the first is taken, though the last digits of the arm differ."""
    for seed in range(4):
        tree, random = random_arm(5, seed, (2,)), np.random.default_rng(seed)
        rounded = replace(tree, position=tree.position * (1.0 + 1e-13 * random.standard_normal((5, 3))))
        assert base_parameters(rounded).names == base_parameters(tree).names


def test_expressions_name_what_is_added() -> None:
    """Of two parallel hinges the second link's mass shows as a first moment of the first link, at the second's axis."""
    n = 2
    planar = replace(
        random_arm(n, 1),
        position=np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.4]]),
        rotation=np.tile(np.eye(3), (n, 1, 1)),
        axis=np.tile([0.0, 1.0, 0.0], (n, 1)),
        gravity=np.array([0.0, 0.0, -9.81]),
    )
    base = base_parameters(planar)
    texts = dict(zip(base.names, base.expressions, strict=True))
    assert texts["m1z"] == "m1z + 0.4 m2"
    assert texts["m2x"] == "m2x"
    assert texts["damping2"] == "damping2"
    units = dict(zip(base.names, base.units, strict=True))
    assert (units["m1z"], units["damping2"], units["coulomb1"]) == ("kg m", "N m s", "N m")
    first, second = (next(name for name in base.names if name in names) for names in (("yy1", "rotor1"), ("yy2",)))
    seen = dict(zip(base.names, seen_by_bias(planar, base).tolist(), strict=True))
    assert not seen[first], "only accelerations show what turns about a fixed axis"
    assert not seen[second]
    assert seen["m1z"]


def test_slides_have_units_of_their_own() -> None:
    """Dry friction of a slide is a force."""
    base = base_parameters(random_arm(2, 1, slides=(1,)))
    units = dict(zip(base.names, base.units, strict=True))
    assert (units["coulomb1"], units["coulomb2"], units["damping2"]) == ("N m", "N", "N s/m")


def test_most_probable_arm_has_the_base_parameters_that_it_is_to_have() -> None:
    """What the torque cannot tell follows from the prior, and what it can is exact; the nominal arm stays itself."""
    tree = random_arm(4, 6)
    prior = ArmPrior(tree)
    values = 1.3 * prior.values
    np.testing.assert_allclose(prior.base.of(prior.tree_at(values).parameters), values, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(prior.tree_at(prior.values).parameters, tree.parameters, rtol=1e-12, atol=1e-13)


def test_most_probable_arm_moves_most_what_is_least_sure() -> None:
    """Where masses are known and inertias are not, a base parameter that has both moves the inertia."""
    tree = random_arm(3, 6)
    prior = ArmPrior(tree, PriorDeviations(mass=1e-4, com=1e-4))
    values = prior.values + 0.1 * np.sqrt(np.diag(prior.covariance))
    changed = prior.parameters_at(values) - tree.parameters
    moved = np.abs(changed[:, 4:10]).max(axis=1) / np.trace(tree.inertia, axis1=1, axis2=2)
    assert np.abs(changed[:, 0] / tree.mass).max() < 1e-2 * moved.max()


def test_prior_spreads_as_random_arms_do() -> None:
    """The covariance of base parameters is that of arms whose masses, centres and inertias are drawn so."""
    tree, random = random_arm(2, 8), np.random.default_rng(0)
    apart = PriorDeviations(mass=0.03, com=0.015, inertia=0.03)
    prior, drawn = ArmPrior(tree, apart), []
    for _ in range(4000):
        mass = tree.mass * (1.0 + apart.mass * random.standard_normal(2))
        lever = np.linalg.norm(tree.com, axis=1, keepdims=True)
        com = tree.com + apart.com * lever * random.standard_normal((2, 3))
        noise = np.array([_symmetric(random) for _ in range(2)])
        moments = np.sqrt(np.einsum("nii,njj->nij", tree.inertia, tree.inertia))
        inertia = tree.inertia + apart.inertia * moments * noise
        drawn.append(replace(tree, mass=mass, com=com, inertia=inertia).parameters)
    base = prior.base
    bodies = [i for i, name in enumerate(base.names) if not name.startswith(("rotor", "damping", "coulomb"))]
    told = np.sqrt(np.diag(base.matrix[:, :] @ _of_bodies(prior) @ base.matrix.T))[bodies]
    seen = base.of(np.array(drawn)).std(axis=0)[bodies]
    np.testing.assert_allclose(seen, told, rtol=0.06)


def _symmetric(random: np.random.Generator) -> Array:
    noise = np.diag(random.standard_normal(3))
    noise[np.triu_indices(3, 1)] = 0.5 * random.standard_normal(3)
    return np.asarray(np.triu(noise) + np.triu(noise, 1).T, dtype=np.float64)


def _of_bodies(prior: ArmPrior) -> Array:
    """The covariance of all parameters, those of the joints left out."""
    bodies = np.tile(np.arange(13) < 10, prior.nominal.njoint)
    return np.asarray(prior.parameter_covariance * np.outer(bodies, bodies), dtype=np.float64)


def test_model_error_is_that_of_what_moves_the_arm() -> None:
    """Nothing where base parameters are right whatever the others are, and of the size of what is wrong with a body."""
    tree = random_arm(3, 2)
    prior = ArmPrior(replace(tree, mass=1.2 * tree.mass))
    same = prior.parameters_at(prior.base.of(tree.parameters))
    assert np.abs(same - tree.parameters).max() > 0.01
    assert model_error(tree, same).largest < 1e-9
    heavier = model_error(tree, replace(tree, mass=1.1 * tree.mass).parameters)
    assert heavier.gravity == pytest.approx(0.1)
    assert 0.0 < heavier.mass_matrix < 0.1
    assert heavier.largest == heavier.gravity


def test_single_hinge_has_no_coriolis_torque_to_be_wrong_about() -> None:
    """What rounding leaves of it is no error, whatever the model."""
    for seed in range(20):
        tree = random_arm(1, seed)
        wrong = model_error(tree, 1.1 * tree.parameters)
        assert wrong.coriolis < 1e-12 < wrong.gravity


def test_balanced_hinge_is_wrong_by_a_share_of_what_accelerates_it() -> None:
    """Neither gravity nor speed loads a body whose mass lies on its axis; a model that is heavy beside it is wrong."""
    tree = replace(random_arm(1, 0), com=np.zeros((1, 3)))
    assert model_error(tree, 1.1 * tree.parameters).gravity == 0.0
    wrong = model_error(tree, replace(tree, com=np.full((1, 3), 0.1)).parameters)
    assert 0.1 < wrong.gravity < 10.0
    assert wrong.coriolis < 1e-12


def test_base_parameters_of_a_planar_chain_are_its_lumps() -> None:
    """First moments are the gravity lumps (Eq. 1), moments of inertia the inertia lumps (Eq. 3), and the torque is that
    of the chain's own model.
    """
    chain = random_plant(4).chain
    prior = ArmPrior(planar_tree(chain, 9.81))
    arm, lumps = prior.nominal, chain.lumps_of(("gravity", "coriolis", "inertia"))
    values = dict(zip(prior.base.names, prior.values.tolist(), strict=True))
    assert [values[f"m{i}z"] for i in range(1, 5)] == pytest.approx(lumps.gravity.tolist())
    assert [values[f"yy{i}"] for i in range(1, 5)] == pytest.approx(chain.inertia_lumps.tolist())
    angles, speeds = np.random.default_rng(2).standard_normal((2, 4))
    model = ChainModel(lumps, 9.81)
    smooth = replace(arm, damping=np.zeros(4), coulomb=np.zeros(4))
    assert joint_torque(smooth, angles, speeds, np.zeros(4)) == pytest.approx(model.torque(angles, speeds))
    assert joint_mass_matrix(arm, angles) == pytest.approx(model.mass_matrix(angles))
    back = planar_chain(prior.nominal)
    assert back is not None
    assert back.lumps.vector == pytest.approx(chain.lumps.vector)
