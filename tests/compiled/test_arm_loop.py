"""Arms at full speed: the compiled episode against plain Python, and twins against MuJoCo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_arm import random_arm

from metaid.compiled import agrees_with_stepwise, fastest_loop
from metaid.compiled.spatial import ArmLoop, QuickSpatial, commanded_arm_torques, frames_of
from metaid.compiled.spatial.vectors import cosine_and_sine
from metaid.compiled.stages import agrees_with_mj_step
from metaid.episode import MEASURES, Episode, FallRule, Record, arm_episode, run_stepwise, same_record, window_ends
from metaid.estimation import BaseUnknowns, ReadTrial, WatchedTrial
from metaid.estimation.trials import Coefficients
from metaid.estimation.twin import Twin, twin_of
from metaid.estimation.twin.workspace import no_joints
from metaid.models import Array
from metaid.models.tree import ArmPrior, Tree, joint_torque
from metaid.plant import ArmPlant, ArmSettings, ArmStart, FaultSettings, FaultyPlant, slope_weights
from metaid.plant.description import arm_model

STEPS = 40


def plant_of(tree: Tree, **faults: object) -> ArmPlant:
    """A plant that is this arm."""
    return ArmPlant("arm", ArmSettings(urdf="arm.urdf", faults=FaultSettings(**faults)), tree)


def episode_of(tree: Tree, pushes: int = 4, steps: int = STEPS, **more: object) -> Episode:
    """Pushes from random states, half of them on springs."""
    random = np.random.default_rng(1)
    states = [
        ArmStart(random.uniform(-1.0, 1.0, tree.njoint), random.uniform(-2.0, 2.0, tree.njoint)) for _ in range(pushes)
    ]
    stiffness = np.where(np.arange(pushes) % 2 == 1, 30.0, 0.0)
    return arm_episode(tree, states, stiffness, steps, window_ends=window_ends(steps), **more)


def hertz(record: Record, episode: Episode) -> float:
    """The kinetic measure."""
    return MEASURES["kinetic"].value(record, episode)


def wrong(tree: Tree) -> Tree:
    """A candidate that is not the arm."""
    return replace(tree, mass=1.2 * tree.mass, coulomb=0.5 * tree.coulomb, rotor=0.8 * tree.rotor)


def at(tree: Tree) -> Twin:
    """The twin that is this arm."""
    unknowns = BaseUnknowns(ArmPrior(tree))
    return twin_of(unknowns, np.zeros(len(unknowns.names))).alone


ARMS = [random_arm(4, 1, friction=False), random_arm(4, 2), random_arm(3, 3, (1,)), random_arm(3, 4, (0,), False)]


@pytest.mark.parametrize("tree", ARMS, ids=["hinges", "rubbed", "rubbed-slide", "slide"])
def test_compiled_episode_is_the_plain_one(tree: Tree) -> None:
    """With hinges and slides, springs, with and without dry friction, all that is seen is the same to rounding."""
    plant, episode, law = plant_of(tree), episode_of(tree), wrong(tree)
    loop = ArmLoop(plant, episode)
    assert agrees_with_stepwise(loop, tree.parameters)
    fast, slow = loop.run(law.parameters), run_stepwise(plant, law.parameters, episode)[0]
    assert same_record(fast, slow)
    assert fast.windows.motion.any()
    np.testing.assert_allclose(hertz(fast, episode), hertz(slow, episode), rtol=1e-9)


@pytest.mark.parametrize("tree", ARMS[1:3], ids=["rubbed", "rubbed-slide"])
def test_rig_is_sent_the_same_torques_by_the_compiled_law(tree: Tree) -> None:
    """A plant of which nothing is known but what it reads: the loop goes step by step, and its law is compiled."""
    plant, episode, law = FaultyPlant(plant_of(tree)), episode_of(tree), wrong(tree)
    loop = fastest_loop(plant, episode, tree.parameters)
    assert isinstance(loop.episode.kind, QuickSpatial)
    assert same_record(loop.run(law.parameters), run_stepwise(plant, law.parameters, episode)[0])


def test_compiled_episode_on_noisy_sensors_is_the_plain_one() -> None:
    """Noise is that of the trial, and the law acts on speeds from angle readings."""
    tree = ARMS[1]
    plant, episode = (
        plant_of(tree, angle_noise=1e-4, speed_sensor=False),
        episode_of(tree, seed=5, readings_steps=STEPS),
    )
    loop = ArmLoop(plant, episode)
    assert agrees_with_stepwise(loop, tree.parameters)
    fast, slow = loop.run(tree.parameters, 3), run_stepwise(FaultyPlant(plant), tree.parameters, episode, 3)[0]
    assert same_record(fast, slow)
    assert not same_record(fast, loop.run(tree.parameters, 4))


@pytest.mark.parametrize(
    "faults",
    [
        {"control_every": 3, "delay": 2, "encoder_step": 1e-3},
        {"torque_limit": 3.0, "torque_gain": (1.1, 0.9, 1.0), "torque_noise": 0.2},
        {"push_noise": 0.05, "speed_noise": 0.01, "encoder_offset": (0.02, -0.03, 0.01), "tilt": (0.05, -0.02)},
    ],
    ids=["control", "drives", "mounting"],
)
def test_faults_of_an_arm_are_the_same_in_both_loops(faults: dict[str, object]) -> None:
    """Whatever a plant file may name, the compiled loop shows what plain Python behind the same faults does, and the
    fault changes what is seen.
    """
    tree = ARMS[2]
    plant, episode = plant_of(tree, **faults), episode_of(tree, seed=5, lead=0.004, readings_steps=STEPS)
    loop, law = ArmLoop(plant, episode), wrong(tree)
    assert agrees_with_stepwise(loop, tree.parameters)
    slow = run_stepwise(FaultyPlant(plant), law.parameters, episode, 3)[0]
    assert same_record(loop.run(law.parameters, 3), slow)
    assert not same_record(loop.run(law.parameters, 3), ArmLoop(plant_of(tree), episode).run(law.parameters))


def test_spring_in_a_joint_of_an_arm_is_the_same_in_both_loops() -> None:
    """It pulls the joint to 0, and the exact law without it does not let the arm coast."""
    tree, episode = ARMS[0], episode_of(ARMS[0])
    plant = plant_of(tree)
    plant.settings = plant.settings.model_copy(update={"stiffness": {tree.names[1]: 2.0}})
    loop = ArmLoop(plant, episode)
    assert agrees_with_stepwise(loop, tree.parameters)
    assert same_record(loop.run(tree.parameters), run_stepwise(plant, tree.parameters, episode)[0])
    assert hertz(loop.run(tree.parameters), episode) > 1e-2


def test_exact_law_leaves_an_arm_to_coast_or_to_swing() -> None:
    """Without dry friction nothing accelerates it beyond what the law asks for; a wrong law does."""
    tree = ARMS[0]
    loop = ArmLoop(plant_of(tree), episode_of(tree))
    assert hertz(loop.run(tree.parameters), loop.episode) < 1e-9
    assert hertz(loop.run(wrong(tree).parameters), loop.episode) > 1e-2


def test_measure_from_noisy_readings_is_nearly_that_of_the_motion() -> None:
    """Curves through readings with 0.1 mrad of noise show what a wrong law accelerates, and little at the exact one."""
    tree = ARMS[0]
    plant, episode = plant_of(tree, angle_noise=1e-4, speed_sensor=False), episode_of(tree, steps=150)
    noisy, silent = ArmLoop(plant, replace(episode, readings_steps=150)), ArmLoop(plant_of(tree), episode)
    law = wrong(tree).parameters
    seen = hertz(noisy.run(law), episode)
    assert seen == pytest.approx(hertz(silent.run(law), episode), rel=0.05)
    assert hertz(noisy.run(tree.parameters), episode) < 0.1 * seen


def test_push_that_falls_leaves_the_others_whole() -> None:
    """A push ends where a joint runs away; its windows up to there are kept, and other pushes go on."""
    tree = ARMS[0]
    episode = episode_of(tree, steps=150)
    calm = episode.pushes * [[0.1], [0.1], [0.1], [1.0]]
    episode = replace(episode, pushes=calm, stiffness=0.0, fall_rule=FallRule(runaway=1.5))
    law = replace(tree, mass=1.6 * tree.mass)
    record = ArmLoop(plant_of(tree), episode).run(law.parameters)
    assert record.fell.any()
    assert not record.fell.all()
    for push in np.flatnonzero(record.fell):
        ended = (record.windows.ends < record.steps[push]).sum()
        assert record.windows.seen[push] == ended
        assert not record.windows.motion[push, ended:].any()
    assert (record.steps[~record.fell] == 150).all()
    assert np.isfinite(hertz(record, episode))


def test_joint_beyond_its_range_has_fallen() -> None:
    """A coast that leaves the range of a joint is a fall."""
    tree = replace(ARMS[0], high=np.full(4, 1.02))
    start = ArmStart(np.full(4, 1.0), np.full(4, 1.0))
    record = ArmLoop(plant_of(tree), arm_episode(tree, [start], np.zeros(1), 50)).run(tree.parameters)
    assert record.fell.all()
    assert record.steps[0] == 11, "0.02 rad at 1 rad/s, in steps of 2 ms"


@pytest.mark.slow
@pytest.mark.parametrize("tree", ARMS, ids=["hinges", "rubbed", "rubbed-slide", "slide"])
def test_twin_with_the_truth_moves_as_mujoco_does(tree: Tree) -> None:
    """Under a wrong law the twin shows the plant's speeds, joints that stick or reverse included."""
    episode, law = episode_of(tree, steps=100), wrong(tree)
    episode = replace(episode, pushes=0.2 * episode.pushes, fall_rule=FallRule(runaway=100.0))
    record = ArmLoop(plant_of(tree), episode).run(law.parameters)
    trial = WatchedTrial(law.parameters, 0.002, episode.states, record.windows, episode.springs)
    twin, other = (
        at(tree.with_parameters(factor * tree.parameters)).watch(trial, len(trial.ends)) for factor in (1.0, 1.1)
    )
    assert (twin.reached == record.windows.seen).all()
    scale = np.abs(record.windows.speeds).max()
    np.testing.assert_allclose(twin.speeds, record.windows.speeds, atol=1e-11 * scale)
    assert np.abs(other.speeds - record.windows.speeds).max() > 1e-4 * scale


def test_driven_twin_shows_what_the_sensors_read() -> None:
    """With the torques that were commanded it moves as the plant did, which acted on noisy readings."""
    tree, law = ARMS[1], wrong(ARMS[1])
    plant, episode = plant_of(tree, angle_noise=1e-4, speed_sensor=False), episode_of(tree, readings_steps=STEPS)
    record = ArmLoop(plant, episode).run(law.parameters)
    assert record.readings is not None
    readings, weights = record.readings.angles, slope_weights(0.002)
    speeds = np.repeat(episode.states[:, 1][:, None], STEPS + 1, axis=1)
    for step in range(len(weights) - 1, STEPS + 1):
        speeds[:, step] = np.einsum("k,pki->pi", weights, readings[:, step + 1 - len(weights) : step + 1])
    torques = commanded_arm_torques(frames_of(tree), law.parameters, episode, readings, speeds)
    pull = -episode.springs[:, None] * (readings[:, 20] - episode.states[:, 0])
    np.testing.assert_allclose(torques[:, 20], joint_torque(law, readings[:, 20], speeds[:, 20], pull), rtol=1e-9)
    starts, seen = episode.states, np.full(episode.npush, STEPS)
    trial = ReadTrial(0.002, readings, torques, seen, starts, None, np.full(tree.njoint, 1e-4))
    basis = np.tile(np.eye(STEPS + 1), (episode.npush, 1, 1))  # each coefficient is the angle at one reading
    twin = at(tree).drive(trial, starts, seen, basis, None)
    assert twin is not None
    difference = twin.values.swapaxes(1, 2) - readings
    assert 0.8e-4 < difference.std() < 1.2e-4


def test_dry_friction_of_an_arm_that_moves_continuously_builds_up_over_a_way() -> None:
    """A joint gives way to a torque that does not break it loose, and half-way back once that is gone, as Dahl's law
    has it in closed form, where the torque changes slowly.
    """
    over, dry, share, steps = 2e-3, 0.8, 0.6, 4000
    given = np.array([dry]), np.array([8.0])
    tree = replace(random_arm(1, 3), gravity=np.zeros(3), rotor=np.ones(1), coulomb=given[0], damping=given[1])
    ramp = 1.0 - np.abs(np.arange(2 * steps) / steps - 1.0)
    torques = share * dry * ramp[None, :, None]
    at_ends = np.eye(2 * steps + 1)[None][..., [steps, 2 * steps]]
    seen, still = np.full(1, 2 * steps), np.zeros((1, 2 * steps + 1, 1))
    trial = ReadTrial(2e-3, still, torques, seen, np.zeros((1, 2, 1)), None, np.ones(1), is_continuous=True)
    joints = no_joints(1, 2)._replace(presliding=np.array([over]))
    twin = at(tree).drive(trial, np.zeros((1, 2, 1)), seen, at_ends, joints)
    assert twin is not None
    bent = -over * np.log(1.0 - share)
    np.testing.assert_allclose(twin.values[0, 0], [bent, bent - over * np.log(1.0 + share)], rtol=0.02)


def test_motion_follows_the_share_with_which_dry_friction_begins() -> None:
    """As its derivatives say, by differences; a joint that begins with all of it is braked from the start."""
    tree, over = ARMS[1], 0.05
    starts = np.concatenate([np.full((1, 1, 4), 0.2), np.ones((1, 1, 4)), 0.5 * np.ones((1, 1, 4))], axis=1)
    still, seen = np.zeros((1, STEPS + 1, 4)), np.full(1, STEPS)
    spread, basis = np.eye(4)[None], np.eye(STEPS + 1)[None]
    trial = ReadTrial(2e-3, still, np.zeros((1, STEPS, 4)), seen, starts[:, :2], spread, np.ones(4), is_continuous=True)
    joints = no_joints(4, 2)._replace(presliding=np.array([over]))

    def ends(shares: Array) -> Coefficients:
        own = starts.copy()
        own[:, 2] = shares
        shown = at(tree).drive(trial, own, seen, basis, joints)
        assert shown is not None
        return shown

    slopes = ends(0.5 * np.ones(4)).slopes[0]
    for joint, step in enumerate(1e-5 * np.eye(4)):
        ahead, behind = ends(0.5 + step).values[0], ends(0.5 - step).values[0]
        by_share = (ahead - behind) / 2e-5
        np.testing.assert_allclose(slopes[..., joint], by_share, atol=1e-6 * np.abs(by_share).max())
        assert by_share[joint, -1] < 0.0


def test_twin_without_a_mass_matrix_is_refused() -> None:
    """A candidate whose mass matrix is not positive definite does not arrive."""
    tree = ARMS[0]
    episode = episode_of(tree)
    record = ArmLoop(plant_of(tree), episode).run(tree.parameters)
    assert record.windows is not None
    trial = WatchedTrial(tree.parameters, 0.002, episode.states, record.windows, episode.springs)
    assert at(tree).watch(trial, len(trial.ends)).reached.all()
    assert not at(tree.with_parameters(-tree.parameters)).watch(trial, len(trial.ends)).reached.any()


@pytest.mark.parametrize("slides", [(), (1,)])
@pytest.mark.parametrize("rubbed", [0, 1, 4])
def test_stages_of_mujoco_are_its_step_on_an_arm(slides: tuple[int, ...], rubbed: int) -> None:
    """Called one by one they move an arm in space to the last bit as `mj_step` does, with slides too, and with dry
    friction in some joints or in all.
    """
    import mujoco

    tree = random_arm(4, 1, slides)
    tree = replace(tree, coulomb=np.where(np.arange(4) < rubbed, tree.coulomb, 0.0))
    model = arm_model(tree, 0.002)
    assert agrees_with_mj_step(model, mujoco.MjData(model))


def test_push_shows_the_same_whatever_was_pushed_before() -> None:
    """The solver of dry friction begins each push afresh."""
    tree = ARMS[1]
    plant, episode = plant_of(tree), episode_of(tree)
    assert episode.poses is not None
    last = replace(episode, pushes=episode.pushes[-1:], poses=episode.poses[-1:], stiffness=episode.springs[-1:])
    alone, together = (ArmLoop(plant, each).run(tree.parameters) for each in (last, episode))
    np.testing.assert_array_equal(alone.windows.motion[0], together.windows.motion[-1])


def test_cosines_and_sines_are_those_of_the_library() -> None:
    """To the last digit but one, in all quarters and after many turns."""
    for angle in (*np.linspace(-7.0, 7.0, 57), 1e3, -1e5, 0.25 * np.pi):
        np.testing.assert_allclose(cosine_and_sine(angle), (np.cos(angle), np.sin(angle)), atol=3e-16)
