"""Noise of the torques moves a plant: the twin is led by its readings, and what it is wrong by at each is noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from watched import GRAVITY, NOISE, raised, watched

from metaid.compiled import Filtered
from metaid.estimation import ChainLaws, Experiment, LogUnknowns, Loop, Readings, ReadTrial, upright
from metaid.estimation.noisy import Innovations, fit_with_torque_noise, unmodelled_forces
from metaid.estimation.trials import Joints
from metaid.estimation.twin import PlanarTwin
from metaid.models import Lumps
from metaid.plant import FaultSettings

TORQUE_NOISE = 0.3  # N m
EVERY, ONE, OTHERS = slice(None), slice(1), slice(1, None)  # of pushes
NOISY = FaultSettings(angle_noise=NOISE, speed_sensor=False, push_noise=0.02, torque_noise=TORQUE_NOISE)


def innovations_of(nlink: int, seed: int, damping: float = 0.0) -> tuple[Innovations, np.ndarray]:
    """Those of two trials of a chain, and its true log factors."""
    seen = watched(nlink, seed, damping=damping, faults=NOISY)
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    trials = [
        replace(seen, episode=replace(seen.episode, seed=2 * seed + number)).read_trial(
            raised(seen.nominal.lumps, factor)
        )
        for number, factor in enumerate((1.0, 1.5))
    ]
    return Innovations(trials, unknowns), unknowns.log_factors(seen.plant.chain.lumps)


def test_chain_is_found_from_a_wrong_one_and_so_is_the_noise_of_its_torques() -> None:
    """To a few percent and within four deviations, from a noise that is said to be a third of what it is."""
    innovations, true = innovations_of(2, 0)
    estimate = fit_with_torque_noise(innovations, None, np.full(2, TORQUE_NOISE / 3.0))
    error = estimate.unknowns - true
    assert estimate.is_explained
    assert 0.8 < estimate.misfit < 1.2
    assert (np.abs(error) < 4.0 * estimate.deviations).all()
    assert np.abs(error).max() < 0.1 < np.abs(true).max()
    assert estimate.torque_noise == pytest.approx(TORQUE_NOISE, rel=0.25)


@pytest.mark.slow
def test_intervals_cover_where_torques_are_noisy() -> None:
    """Nine to ten in ten lumps of eight chains lie in their 95 % interval."""
    inside = []
    for seed in range(8):
        innovations, true = innovations_of(2, seed)
        estimate = fit_with_torque_noise(innovations, None, np.full(2, TORQUE_NOISE))
        low, high = estimate.interval_with(estimate.value_deviations)
        lumps = innovations.unknowns.lumps(true).vector_of(innovations.unknowns.kinds)
        inside += ((low < lumps) & (lumps < high)).tolist()
    assert np.mean(inside) >= 0.85


def test_derivatives_of_innovations_are_those_of_their_differences() -> None:
    """With gains that are given, of lumps and of start speeds."""
    innovations, true = innovations_of(2, 1)
    point = np.append(true, np.zeros(innovations.extras)) + 0.01
    led = innovations.led(point, np.full(2, TORQUE_NOISE))
    assert led is not None
    count = len(true)
    slopes = np.concatenate([led._compare(led._posed_at(0, point), 1)[1]])  # type: ignore[index]
    for column in (0, 2, 4):
        step = 1e-6 * np.eye(len(point))[column]
        more, less = (led._compare(led._posed_at(0, point + sign * step), 1) for sign in (1.0, -1.0))
        assert more is not None
        assert less is not None
        difference = (more[0] - less[0]) / 2e-6
        assert np.allclose(slopes[..., column], difference, atol=1e-5 * np.abs(difference).max())
    speeds = np.zeros(len(point))
    speeds[count] = 1e-6  # of the first push alone
    more, less = (led._compare(led._posed_at(0, point + sign * speeds), 1) for sign in (1.0, -1.0))
    assert more is not None
    assert less is not None
    assert np.allclose(slopes[0, :, count], (more[0] - less[0])[0] / 2e-6, atol=1e-4)


def test_likelihood_is_that_of_all_readings_together() -> None:
    """Of a link without gravity, which moves linearly: its readings are normal with a covariance that is at hand."""
    steps, timestep, inertia, noise, torque = 8, 0.01, 0.05, 1e-3, 0.4
    readings = 0.01 * np.random.default_rng(0).normal(size=(1, steps + 1, 1))
    commanded, start = np.full((1, steps, 1), 0.2), upright(np.array([[0.3]]))
    trial = ReadTrial(timestep, readings, commanded, np.array([steps]), start, None, np.array([noise]))
    lumps = Lumps(np.array([1.0]), np.zeros((1, 1)), inertia=np.array([inertia]))
    innovations = Innovations([trial], LogUnknowns(lumps, 0.0, ("inertia",)))

    # A torque in step s moves reading t > s by h² (t − s) / d.
    later = np.subtract.outer(np.arange(steps + 1), np.arange(steps)).clip(min=0) * timestep**2 / inertia
    covariance = torque**2 * later @ later.T + noise**2 * np.eye(steps + 1)
    left = readings[0, :, 0] - 0.3 * timestep * np.arange(steps + 1) - later @ commanded[0, :, 0]
    expected = -0.5 * (left @ np.linalg.solve(covariance, left) + np.linalg.slogdet(covariance)[1])
    assert innovations.likelihood(np.zeros(1), np.array([torque]), 1) == pytest.approx(expected)


def test_likelihood_of_other_sizes_follows_from_one_run() -> None:
    """That of the filter is the same where it is, and nearly the same with one joint's noise half as large again."""
    innovations, true = innovations_of(2, 1)
    (one, *_), sizes = innovations.filters(np.append(true, np.zeros(innovations.extras)), 48), np.full(2, TORQUE_NOISE)
    likelihood = one.likelihood_about(sizes)
    other = sizes * [1.5, 0.7]
    (same, less), alone = likelihood(np.array([sizes, other]), EVERY), other[None]
    assert same == pytest.approx(one.gains(sizes).likelihood, abs=1e-6)
    lost = one.gains(sizes).likelihood - one.gains(other).likelihood
    assert lost > 1.0
    assert likelihood(alone, ONE) + likelihood(alone, OTHERS) == pytest.approx(likelihood(alone, EVERY))
    assert likelihood(alone, EVERY) == pytest.approx([less])
    assert same - less == pytest.approx(lost, rel=1e-2)


def test_thinned_trial_has_one_reading_in_three_and_the_mean_of_the_torques_between() -> None:
    """A push that was not seen to the end of a longer step was seen to its begin."""
    seen = watched(2, faults=NOISY)
    trial = seen.read_trial(raised(seen.nominal.lumps, 1.3))
    thinned, count = trial.thinned(3), trial.torques.shape[1] // 3
    assert thinned.timestep == pytest.approx(3.0 * trial.timestep)
    np.testing.assert_array_equal(thinned.readings, trial.readings[:, : 3 * count + 1 : 3])
    np.testing.assert_allclose(thinned.torques[:, 1], trial.torques[:, 3:6].mean(axis=1))
    np.testing.assert_array_equal(thinned.steps, trial.steps // 3)


def test_what_the_filter_finds_of_a_push_depends_on_no_other() -> None:
    """Dry friction that builds up begins anew in each, whichever went before on the same thread."""
    seen = watched(2, faults=NOISY)
    trial = replace(seen.read_trial(raised(seen.nominal.lumps, 1.3)), is_continuous=True)
    none, twin = np.zeros(2), PlanarTwin(LogUnknowns(seen.nominal.lumps, GRAVITY), np.zeros(5))
    joints = Joints(
        none, np.full(2, 0.05 * TORQUE_NOISE), none, none, np.zeros(1), none, np.array([1e-3]), np.zeros((3, 2))
    )

    def led(*pushes: int) -> Filtered:
        starts = upright(trial.start_speeds)
        begins = np.tile(1e-2 * np.eye(4), (len(starts), 1, 1))
        return twin.lead(trial, starts, begins, np.array(pushes), joints).gains(np.full(2, TORQUE_NOISE))

    together = led(0, 1, 2, 3)
    for push in (2, 3):
        alone = led(push)
        assert np.isfinite(alone.likelihood)
        assert np.array_equal(together.gains[push], alone.gains[push])


def test_hidden_friction_is_not_taken_for_noise_of_the_torques() -> None:
    """Noise does not last: what does shows in the slow innovations, or as a force that the model has not."""
    innovations, _ = innovations_of(2, 0, damping=0.3)
    estimate = fit_with_torque_noise(innovations, None, np.full(2, TORQUE_NOISE))
    assert estimate.torque_noise is not None
    led = innovations.led(estimate.point, estimate.torque_noise)
    assert led is not None
    assert not estimate.is_explained or any(each.is_seen for each in unmodelled_forces(led, estimate))


def test_readings_are_compared_as_ever_where_torques_have_no_noise() -> None:
    """An experiment that says nothing of noisy torques compares readings, and finds no size of it."""
    seen = watched(2, faults=NOISY.model_copy(update={"torque_noise": 0.0}))
    lumps = seen.nominal.lumps
    laws, loop = ChainLaws(lumps, GRAVITY), Loop(0.002, np.full(2, NOISE), np.array([-1.0, 0.0, 1.0]))
    experiment = Experiment(laws, LogUnknowns(lumps, GRAVITY), 0.002, upright(seen.starts), loop=loop)
    trial = seen.read_trial(raised(lumps, 1.5))
    assert type(experiment._comparison([trial])) is Readings
    assert type(replace(experiment, torque_noise=np.full(2, 0.3))._comparison([trial])) is Innovations
    estimate = experiment.estimate([trial])
    assert estimate is not None
    assert estimate.torque_noise is None
