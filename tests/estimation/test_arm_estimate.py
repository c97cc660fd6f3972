"""What trials say of an arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from random_arm import random_arm, wrong_tree

from metaid.compiled.spatial import ArmLoop
from metaid.episode import Episode, SensorReadings, Spatial, arm_episode, window_ends
from metaid.estimation import (
    ArmEstimate,
    ArmLaws,
    BaseUnknowns,
    Loop,
    Motions,
    Readings,
    ReadTrial,
    SeenTrial,
    WatchedTrial,
    fit,
)
from metaid.estimation.noisy import Innovations
from metaid.models import Array
from metaid.models.tree import ArmPrior, Tree
from metaid.plant import ArmPlant, ArmSettings, ArmStart, FaultSettings, slope_weights

NOISE = 1e-4
EVERY = slice(None)
STEPS = 100


def plant_of(tree: Tree, noise: float = 0.0) -> ArmPlant:
    """A plant that is this arm; with noise it has no sensor of speeds."""
    faults = FaultSettings(angle_noise=noise, speed_sensor=not noise)
    return ArmPlant("arm", ArmSettings(urdf="arm.urdf", faults=faults), tree)


def nominal_of(tree: Tree, seed: int = 3) -> Tree:
    """What is believed of `tree`: bodies wrong at random, rotors and friction unknown."""
    return wrong_tree(tree, seed)


def episode_of(tree: Tree, pushes: int, seed: int = 1) -> Episode:
    """Two coasts for each push on springs."""
    random = np.random.default_rng(seed)
    states = random.uniform(-1.5, 1.5, (pushes, 2, tree.njoint)) * [[1.0], [1.5]]
    stiffness = np.where(np.arange(pushes) % 3 == 2, 30.0, 0.0)
    starts = [ArmStart(*state) for state in states]
    return arm_episode(tree, starts, stiffness, STEPS, window_ends=window_ends(STEPS))


def read(plant: ArmPlant, searched: BaseUnknowns, law: Array, episode: Episode, number: int) -> ReadTrial:
    """A trial on noisy sensors."""
    record = ArmLoop(plant, replace(episode, readings_steps=STEPS)).run(law, number)
    assert record.readings is not None
    return read_trial(searched, law, episode, record.readings)


def read_trial(searched: BaseUnknowns, law: Array, episode: Episode, readings: SensorReadings) -> ReadTrial:
    """That in which a law led to these readings."""
    commanded = partial(ArmLaws(searched, episode).commanded, law)
    return loop_of(episode.njoint).trial(readings, episode.states, commanded)


def watched(plant: ArmPlant, nominal: Tree, episode: Episode) -> WatchedTrial:
    """A trial on exact sensors under the law of the nominal arm."""
    record = ArmLoop(plant, replace(episode, kind=Spatial(nominal))).run(nominal.parameters)
    assert record.windows is not None
    return WatchedTrial(nominal.parameters, record.timestep, episode.states, record.windows, episode.springs)


def estimate_arm(trials: Sequence[SeenTrial], searched: BaseUnknowns, before: ArmEstimate | None = None) -> ArmEstimate:
    """What all `trials` say, from the estimate `before` on."""
    start = None if before is None else before.start
    compared = (Readings if isinstance(trials[0], ReadTrial) else Motions)(trials, searched)
    found: ArmEstimate = fit(compared, start, refines=start is not None)
    return found


def loop_of(njoint: int) -> Loop:
    """Sensors with noise, read every 2 ms."""
    return Loop(0.002, np.full(njoint, NOISE), slope_weights(0.002))


def share_wrong(searched: BaseUnknowns, tree: Tree, values: Array) -> float:
    """By which share of what was not known the base parameters are wrong, the worst of them."""
    known = np.sqrt(np.diag(searched.prior.covariance))
    return float(np.abs((values - searched.prior.base.of(tree.parameters)) / known).max())


@pytest.mark.parametrize(("njoint", "slides"), [(3, ()), (3, (1,))])
def test_one_trial_tells_all_base_parameters(njoint: int, slides: tuple[int, ...]) -> None:
    """Rotors, viscous and dry friction and what the mass matrix alone shows included, with the nominal law."""
    tree = random_arm(njoint, 2, slides)
    searched = BaseUnknowns(ArmPrior(nominal_of(tree)))
    episode = episode_of(tree, 9)
    trial = watched(plant_of(tree), searched.prior.nominal, episode)
    estimate = estimate_arm([trial], searched)
    assert estimate.is_explained
    assert share_wrong(searched, tree, searched.prior.values) > 0.3
    assert share_wrong(searched, tree, estimate.values) < 1e-6
    assert estimate.names == searched.prior.base.names
    assert [table.shape for table in estimate.residuals] == [(9, njoint)]
    np.testing.assert_allclose(searched.prior.base.of(estimate.parameters), estimate.values, atol=1e-12)
    again = estimate_arm([trial], searched, estimate)
    assert again.iterations == 0, "an estimate that explains its trials is where the fit begins"


def test_fit_begins_at_an_arm_with_heavier_rotors() -> None:
    """Nothing else of it differs from the nominal arm, so its mass matrix is farther from singular."""
    searched = BaseUnknowns(ArmPrior(random_arm(3, 2)))
    base = searched.prior.base
    change = searched.values(searched.begin) - searched.prior.values
    rotors = np.array(["rotor" in expression for expression in base.expressions])
    assert (change[rotors] > 0.0).all()
    np.testing.assert_allclose(change[~rotors], 0.0, atol=1e-9)


def test_less_than_no_friction_is_not_the_mirror_image_of_friction() -> None:
    """A twin with negative dry friction is driven on, so that a descent from there leads to the friction there is."""
    tree = random_arm(2, 5)
    mirrored = tree.parameters.copy()
    mirrored[:, 12] *= -1.0
    searched = BaseUnknowns(ArmPrior(tree))
    episode = episode_of(tree, 3)
    trial = watched(plant_of(tree), tree, episode)
    point = np.linalg.solve(searched.root, searched.prior.base.of(mirrored) - searched.prior.values)
    there = Motions([trial], searched).residuals(point, 5)
    assert there is not None
    assert np.abs(there.values).max() > 1e6
    estimate = estimate_arm([trial], BaseUnknowns(ArmPrior(tree.with_parameters(mirrored))))
    np.testing.assert_allclose(estimate.values, searched.prior.values, rtol=1e-6, atol=1e-7)


def test_what_a_push_showed_before_it_fell_is_used() -> None:
    """A trial whose pushes all ended early still tells."""
    tree = random_arm(3, 2)
    narrow = replace(nominal_of(tree), low=np.full(3, -1.5), high=np.full(3, 1.5))  # a coast leaves it
    searched, trial = BaseUnknowns(ArmPrior(narrow)), watched(plant_of(tree), narrow, episode_of(tree, 9))
    assert not trial.seen(len(trial.ends)).all()
    estimate = estimate_arm([trial], searched)
    assert estimate.is_explained
    assert share_wrong(searched, tree, estimate.values) < 1e-5


def test_an_arm_that_is_built_otherwise_is_not_explained() -> None:
    """Where a joint is not where it is believed to be, the misfit says so."""
    tree = random_arm(3, 2)
    moved = tree.position.copy()
    moved[1] += [0.02, 0.0, 0.0]
    nominal = nominal_of(replace(tree, position=moved))
    episode = episode_of(tree, 9)
    trial = watched(plant_of(tree), nominal, episode)
    estimate = fit(Motions([trial], BaseUnknowns(ArmPrior(nominal))), restarts=0)
    assert not estimate.is_explained


def test_noisy_readings_tell_base_parameters_within_their_intervals() -> None:
    """With 0.1 mrad and no sensor of speeds, errors are as large as they are said to be."""
    tree = random_arm(3, 2)
    searched = BaseUnknowns(ArmPrior(nominal_of(tree)))
    plant, law, trials, estimate = plant_of(tree, NOISE), searched.prior.nominal.parameters, [], None
    for number in range(2):
        trials.append(read(plant, searched, law, episode_of(tree, 9), number))
        estimate = estimate_arm(trials, searched, estimate)
        assert estimate.is_explained
        law = estimate.parameters
    away = (estimate.values - searched.prior.base.of(tree.parameters)) / estimate.value_deviations
    assert np.abs(away).max() < 4.0
    assert 0.6 < np.sqrt((away**2).mean()) < 1.4
    assert share_wrong(searched, tree, estimate.values) < 0.1
    beside = estimate.unknowns + 0.02 * np.linalg.cholesky(estimate.covariance)[:, 0]
    again = estimate_arm(trials, searched, replace(estimate, unknowns=beside))
    assert again.iterations == 0, "two hundredths of a standard deviation are not worth a step"
    low, high = estimate.interval_with(estimate.value_deviations)
    np.testing.assert_allclose(high - low, 2.0 * 1.96 * estimate.value_deviations)
    assert 0.0 < estimate.shares(None)[0].min() < estimate.shares(None)[0].max() < 0.1


def test_likelihood_of_other_torque_noise_follows_from_one_run() -> None:
    """That of the filter is the same where it is, and nearly the same with one joint's noise half as large again."""
    tree = random_arm(3, 2)
    searched = BaseUnknowns(ArmPrior(tree))
    trial = read(plant_of(tree, NOISE), searched, tree.parameters, episode_of(tree, 9), 0)
    innovations = Innovations([trial], searched)
    (one,), sizes = innovations.filters(np.zeros(len(innovations.spreads) + innovations.extras), 9), np.full(3, 0.1)
    likelihood, other = one.likelihood_about(sizes), np.array([0.15, 0.07, 0.1])
    same, less = likelihood(np.array([sizes, other]), EVERY)
    assert same == pytest.approx(one.gains(sizes).likelihood, abs=1e-6)
    lost = one.gains(sizes).likelihood - one.gains(other).likelihood
    assert abs(lost) > 1.0
    assert same - less == pytest.approx(lost, rel=1e-2)


@pytest.mark.slow
def test_starts_that_are_not_exact_are_found_with_the_rest() -> None:
    """Where poses and speeds at the start differ from what they were to be, their spread is all that need be known."""
    tree, random = random_arm(3, 2, friction=False), np.random.default_rng(5)
    searched = BaseUnknowns(ArmPrior(nominal_of(tree)))
    law, spread = searched.prior.nominal.parameters, np.array([[1e-3] * 3, [1e-2] * 3])
    episode = episode_of(tree, 9)
    states = episode.states + spread * random.standard_normal(episode.states.shape)
    moved = replace(episode, poses=states[:, 0], pushes=states[:, 1], readings_steps=STEPS)
    record = ArmLoop(plant_of(tree, NOISE), moved).run(law)
    # The law acts on the pose that the arm was to have; here that is where its springs are.
    assert record.readings is not None
    trial = replace(read_trial(searched, law, moved, record.readings), starts=episode.states)
    root = np.broadcast_to(np.diag(spread.ravel()), (9, 6, 6))
    wrong, right = (fit(Readings([replace(trial, start_spread=each)], searched), restarts=0) for each in (None, root))
    assert not wrong.is_explained
    assert right.is_explained
    assert len(right.extras) == 9 * 6
    away = (right.values - searched.prior.base.of(tree.parameters)) / right.value_deviations
    assert np.abs(away).max() < 4.5


def compared_of(tree: Tree, noise: float) -> Sequence[Motions | Readings]:
    """What is compared of one trial."""
    searched = BaseUnknowns(ArmPrior(nominal_of(tree)))
    nominal, episode, plant = searched.prior.nominal, episode_of(tree, 3), plant_of(tree, noise)
    if noise:
        trial = read(plant, searched, nominal.parameters, episode, 0)
        spread = np.broadcast_to(1e-2 * np.eye(tree.njoint), (episode.npush, tree.njoint, tree.njoint))
        return [Readings([replace(trial, start_spread=spread)], searched)]
    return [Motions([watched(plant, nominal, episode)], searched)]


@pytest.mark.parametrize("noise", [0.0, NOISE])
def test_derivatives_are_those_of_the_residuals(noise: float) -> None:
    """By central differences, on all windows; starts follow where they serve best."""
    tree = random_arm(2, 4, friction=False)
    (compared,) = compared_of(tree, noise)
    searched = compared.unknowns
    count = len(searched.names)
    truth = np.linalg.solve(searched.root, searched.prior.base.of(tree.parameters) - searched.prior.values)
    point = np.append(truth + 0.001 * np.random.default_rng(0).standard_normal(count), np.zeros(compared.extras))
    here = compared.residuals(point, compared.stages)
    assert here is not None
    for column in range(0, count, 3):
        step = 1e-4 * np.eye(count)[column]
        costs = []
        for sign in (1.0, -1.0):
            following = here.following @ np.append(1.0, sign * step)
            there = compared.residuals(point + np.append(sign * step, following), compared.stages)
            assert there is not None
            costs.append(there.cost)
        slope = (costs[0] - costs[1]) / 2e-4
        scale = float(np.linalg.norm(here.values) * np.linalg.norm(here.slopes[:, column]))
        assert abs(slope - here.values @ here.slopes[:, column]) < (1e-2 if noise else 1e-4) * scale, (
            "what follows is linear"
        )


def test_arms_without_a_mass_matrix_are_refused() -> None:
    """A point at which the mass matrix is not positive definite has no residuals, so no step leads there."""
    (compared,) = compared_of(random_arm(2, 4), 0.0)
    searched = compared.unknowns
    negative = np.linalg.solve(searched.root, -3.0 * searched.prior.values)
    assert compared.residuals(negative, 1) is None
    assert np.isnan(compared.by_joint(negative)[0]).all()
