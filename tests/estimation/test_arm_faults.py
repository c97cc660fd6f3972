"""Faults of an arm as unknowns of the fit, on MuJoCo's arm that has them."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from random_arm import random_arm
from slopes import assert_slopes

from metaid.estimation import BaseUnknowns, Readings, ReadTrial, fit, searched_faults
from metaid.estimation.noisy import Innovations, as_possible, led, take_up, unmodelled_forces
from metaid.models import Array
from metaid.models.tree import ArmPrior, Tree, joint_torque
from metaid.plant.description import arm_model

pytestmark = pytest.mark.slow

NOISE, TIMESTEP, STEPS, PUSHES = 1e-4, 0.002, 150, 8
DELAY, TILT, OFFSET, SPRING = 0.004, np.array([0.02, -0.03]), np.array([0.0, 0.02, -0.015]), np.array([1.0, 0.6, 0.8])
TRUE = {"delay": [DELAY], "tilt": TILT, "offset": OFFSET, "spring": SPRING}


def nominal_of(tree: Tree) -> Tree:
    """An arm that is believed to be 5 to 10 % other."""
    return replace(tree, mass=1.1 * tree.mass, com=0.95 * tree.com, inertia=1.1 * tree.inertia)


def pushed(
    tree: Tree, kinds: tuple[str, ...], seed: int = 0, limits: Array | float = np.inf, pushes: int = PUSHES
) -> ReadTrial:
    """What sensors of MuJoCo's arm read that has faults of these `kinds`, under torques that no law makes and that are
    cut off at `limits` (njoint), in N m.
    """
    random, n = np.random.default_rng(seed), tree.njoint
    model = arm_model(tree, TIMESTEP)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT)
    if "tilt" in kinds:
        about_x, about_y = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(about_x, np.array([1.0, 0.0, 0.0]), TILT[0])
        mujoco.mju_axisAngle2Quat(about_y, np.array([0.0, 1.0, 0.0]), TILT[1])
        both, gravity = np.zeros(4), np.zeros(3)
        mujoco.mju_mulQuat(both, about_y, about_x)
        mujoco.mju_negQuat(about_x, both)
        mujoco.mju_rotVecQuat(gravity, np.array(tree.gravity), about_x)
        model.opt.gravity[:] = gravity
    if "spring" in kinds:
        model.jnt_stiffness[:], model.qpos_spring[:] = SPRING, 0.0
    data, late = mujoco.MjData(model), round(DELAY / TIMESTEP) if "delay" in kinds else 0
    poses, speeds = random.uniform(-1.0, 1.0, (pushes, n)), random.uniform(-2.0, 2.0, (pushes, n))
    times = TIMESTEP * np.arange(STEPS)[:, None]
    readings, torques = np.zeros((pushes, STEPS + 1, n)), np.zeros((pushes, STEPS, n))
    offset = OFFSET if "offset" in kinds else np.zeros(n)
    for push in range(pushes):
        held = joint_torque(tree, poses[push], np.zeros(n), np.zeros(n))
        torques[push] = held * (1.0 + random.uniform(-0.5, 0.5, n) * np.sin(random.uniform(5.0, 20.0, n) * times))
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = poses[push], speeds[push]
        for step in range(STEPS + 1):
            readings[push, step] = data.qpos + offset
            if step < STEPS:
                commanded = torques[push, step - late] if step >= late else np.zeros(n)
                data.qfrc_applied[:] = np.clip(commanded, -limits, limits)
                mujoco.mj_step(model, data)
    noisy = readings + NOISE * random.standard_normal(readings.shape)
    steps = np.full(pushes, STEPS)
    starts = np.stack([poses + offset, speeds], axis=1)
    return ReadTrial(TIMESTEP, noisy, torques, steps, starts, None, np.full(n, NOISE))


def some_noise(searched: BaseUnknowns, trial: ReadTrial) -> Array:
    """What noise of the torques may be, in N m: a share of what each joint needs (njoint)."""
    return 0.03 * searched.torques(float(np.abs(trial.start_speeds).max()))


def searched_of(searched: BaseUnknowns, kinds: tuple[str, ...], trial: ReadTrial) -> Array:
    """The faults of these `kinds` that one trial shows, in deviations from the truth."""
    wanted = searched_faults(kinds, searched, trial.start_speeds)
    estimate = fit(Readings([trial], searched, faults=wanted), restarts=0)
    assert estimate.is_explained
    found = estimate.faults
    true = np.concatenate([np.asarray(TRUE[kind]) for kind in kinds])
    return np.asarray((found.values - true) / found.deviations)


@pytest.mark.parametrize("is_led", [False, True])
@pytest.mark.parametrize(("is_continuous", "rubs"), [(False, False), (False, True), (True, True)])
@pytest.mark.parametrize(
    "kinds", [("delay", "offset", "viscous", "spring", "gain", "cogging", "bias", "dry", "presliding"), ("tilt", "lag")]
)
def test_slopes_by_all_that_is_unknown_are_those_of_the_residuals(
    kinds: tuple[str, ...], is_continuous: bool, rubs: bool, is_led: bool
) -> None:
    """Of an arm with a slide away from the truth: by base parameters and faults, whether a filter leads the twin or
    none; where joints stick, too, and where dry friction builds up.
    """
    tree = random_arm(3, 2, (2,), friction=rubs)
    kinds = tuple(kind for kind in kinds if is_continuous or kind not in ("dry", "presliding"))
    trial, searched = pushed(tree, (), pushes=2), BaseUnknowns(ArmPrior(nominal_of(tree), tilts=True))
    trial = replace(trial, is_continuous=is_continuous)
    wanted = searched_faults(kinds, searched, trial.start_speeds, teeth=9)
    readings: Readings | None = Readings([trial], searched, faults=wanted)
    point = 0.005 * np.random.default_rng(0).standard_normal(len(readings.spreads))
    if is_led:
        readings = Innovations([trial], searched, faults=wanted).led(point, some_noise(searched, trial))
        assert readings is not None
    assert_slopes(readings, point)


@pytest.mark.parametrize("kinds", [("delay", "tilt"), ("offset", "spring")])
def test_faults_of_an_arm_are_found_with_its_base_parameters(kinds: tuple[str, ...]) -> None:
    """Within four deviations; without them the model does not explain what was read."""
    tree = random_arm(3, 2, friction=False)
    searched, trial = BaseUnknowns(ArmPrior(nominal_of(tree))), pushed(tree, kinds)
    plain = fit(Readings([trial], searched), restarts=0)
    assert not plain.is_explained
    assert np.abs(searched_of(searched, kinds, trial)).max() < 4.0


def test_torques_at_which_motors_cut_off_are_found() -> None:
    """Within four deviations: each gives seven tenths of the most that it is told to."""
    tree = random_arm(3, 2, friction=False)
    limits = 0.7 * np.abs(pushed(tree, (), pushes=4).torques).max(axis=(0, 1))
    searched, trial = BaseUnknowns(ArmPrior(nominal_of(tree))), pushed(tree, (), limits=limits, pushes=4)
    plain = fit(Readings([trial], searched), restarts=0)
    assert not plain.is_explained
    found, taken = take_up(Readings([trial], searched), plain)
    assert found.is_explained
    assert found.faults is not None
    assert taken is not None
    assert taken.kinds == ("limit",)
    assert np.abs((found.faults.values - limits) / found.faults.deviations).max() < 4.0


def test_arm_without_faults_needs_none() -> None:
    """Its base parameters lie within five deviations each."""
    tree = random_arm(3, 2, friction=False)
    searched, trial = BaseUnknowns(ArmPrior(nominal_of(tree))), pushed(tree, ())
    estimate = fit(Readings([trial], searched), restarts=0)
    assert estimate.is_explained
    off = (estimate.values - searched.prior.base.of(tree.parameters)) / estimate.value_deviations
    assert np.abs(off).max() < 5.0


def test_fault_that_explains_an_arm_is_proposed() -> None:
    """A delay that nobody has named is what explains the readings of an arm."""
    tree = random_arm(3, 2, friction=False)
    searched, trial = BaseUnknowns(ArmPrior(nominal_of(tree))), pushed(tree, ("delay",))
    readings = Readings([trial], searched)
    plain = fit(readings, restarts=0)
    found, _ = take_up(readings, plain)
    assert found.is_explained
    assert found.faults is not None
    assert found.faults.searched.kinds == ("delay",)
    assert found.faults.values[0] == pytest.approx(DELAY, rel=0.1)


def test_joint_that_is_elsewhere_and_hides_in_the_noise_is_held_by_what_geometry_leaves_open() -> None:
    """Joints are off by 2 mm: a number is wrong by hundreds of deviations, and none by four with what geometry adds."""
    believed = nominal_of(random_arm(3, 2, friction=False))
    ways = np.random.default_rng(1).normal(scale=0.002, size=believed.position.shape)
    true = replace(random_arm(3, 2, friction=False), position=believed.position + ways)
    searched = BaseUnknowns(ArmPrior(believed))
    readings = Readings([pushed(true, ())], searched)
    estimate = fit(readings, restarts=0)
    geometry = next(each for each in unmodelled_forces(readings, estimate) if each.kind == "geometry")
    error = estimate.values - searched.prior.base.of(true.parameters)
    wide = np.hypot(estimate.value_deviations, np.linalg.norm(searched.root @ geometry.left_open, axis=1))
    assert estimate.is_explained
    assert np.abs(error / estimate.value_deviations).max() > 100.0
    assert np.abs(error / wide).max() < 4.0


@pytest.mark.parametrize("is_led", [False, True])
def test_estimate_that_no_arm_can_have_is_handed_over_as_near_as_one_can(is_led: bool) -> None:
    """Of what trials hardly show it is the nearest that bodies have; the delay and the starts follow."""
    tree = random_arm(3, 2)
    searched, trial = BaseUnknowns(ArmPrior(nominal_of(tree))), pushed(tree, ("delay",), seed=2, pushes=2)
    trial = replace(trial, start_spread=np.broadcast_to(1e-2 * np.eye(3), (2, 3, 3)))
    readings = Readings([trial], searched, faults=searched_faults(("delay",), searched, trial.start_speeds))
    found = fit(readings, restarts=0)
    if is_led:
        found = led(readings, replace(found, torque_noise=some_noise(searched, trial)))
    assert as_possible(readings, found) is found
    variances, axes = np.linalg.eigh(found.covariance)
    far = replace(found, unknowns=found.unknowns + 2.0 * np.sqrt(variances[-1]) * axes[:, -1])
    assert not far.is_possible
    possible = as_possible(readings, far)
    assert possible.is_possible
    step = possible.unknowns - far.unknowns
    assert step @ np.linalg.solve(found.covariance, step) < 4.0
    assert possible.misfit < found.explained_below
    assert possible.faults.values == pytest.approx([DELAY], rel=0.05)
    assert (possible.faults.values != far.faults.values).all()
    assert not np.array_equal(possible.extras, far.extras)
