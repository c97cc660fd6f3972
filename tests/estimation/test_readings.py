"""On a noisy plant the twin is driven by what was commanded; intervals cover, and the misfit is one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from watched import GRAVITY, NOISE, TIMESTEP, raised, watched

from metaid.estimation import ChainLaws, LogUnknowns, Readings, fit
from metaid.estimation.noisy.polynomials import eliminated
from metaid.models import ChainModel
from metaid.plant import FaultSettings

NOISY = FaultSettings(angle_noise=NOISE, speed_sensor=False)
DIFFERING = FaultSettings(angle_noise=NOISE, speed_sensor=False, push_noise=0.02)


def test_commanded_torques_are_those_of_the_law_on_its_readings() -> None:
    """As the plain loop computes them, one at a time."""
    seen = watched(3)
    law = raised(seen.nominal.lumps, 1.5)
    readings, speeds = np.random.default_rng(0).normal(size=(2, 2, 4, 3))
    torques = ChainLaws(seen.nominal.lumps, GRAVITY).commanded(law, readings, speeds)
    expected = ChainModel(law, GRAVITY).torque(readings[1, 2], speeds[1, 2])
    assert torques.shape == (2, 3, 3)
    assert np.allclose(torques[1, 2], expected)


@pytest.mark.parametrize("faults", [NOISY, DIFFERING])
def test_one_noisy_trial_gives_all_lumps_within_their_deviations(faults: FaultSettings) -> None:
    """To a few percent and within four standard deviations each, with residuals of the size of the noise."""
    seen = watched(3, faults=faults)
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    estimate = fit(Readings([seen.read_trial(raised(seen.nominal.lumps, 1.5))], unknowns))
    error = estimate.unknowns - unknowns.log_factors(seen.plant.chain.lumps)
    assert 0.7 < estimate.misfit < 1.3
    assert np.abs(error).max() < 0.05
    assert (np.abs(error) < 4.0 * estimate.deviations).all()


@pytest.mark.parametrize(("nlink", "seed"), [(3, 6), (4, 7)])
def test_fit_that_leaves_the_valley_of_the_truth_goes_on_with_windows_that_grow_by_less(nlink: int, seed: int) -> None:
    """These chains, watched for long, end with a misfit of 1,301 and of 655 where windows always double."""
    seen = watched(nlink, seed, faults=DIFFERING, longer=2.5)
    trial = seen.read_trial(raised(seen.nominal.lumps, 1.5))
    assert fit(Readings([trial], LogUnknowns(seen.nominal.lumps, GRAVITY)), restarts=0).misfit < 1.3


def test_intervals_cover() -> None:
    """Nine to ten in ten lumps of eight chains lie in their 95 % interval."""
    inside = []
    for seed in range(8):
        seen = watched(2, seed, faults=DIFFERING)
        unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
        estimate = fit(Readings([seen.read_trial(raised(seen.nominal.lumps, 1.5))], unknowns))
        low, high = estimate.interval_with(estimate.value_deviations)
        true = seen.plant.chain.lumps_of(unknowns.kinds).vector_of(unknowns.kinds)
        inside += ((low < true) & (true < high)).tolist()
    assert np.mean(inside) >= 0.85


@pytest.mark.parametrize("faults", [NOISY, DIFFERING])
def test_replay_differs_from_the_readings_by_their_noise(faults: FaultSettings) -> None:
    """The twin begins with the start speeds of the fit: with the calibrated ones it would be far off after pushes that
    differ. After a fall there is nothing.
    """
    seen = watched(2, faults=faults)
    trial = seen.read_trial(raised(seen.nominal.lumps, 1.5))
    trial = replace(trial, steps=np.array([len(trial.readings[0]) - 1, 80, 80, 0]))
    readings = Readings([trial, trial], LogUnknowns(seen.nominal.lumps, GRAVITY))
    replay = readings.replay(1, fit(readings).point)
    difference = replay.simulated - replay.seen
    assert np.isnan(difference[3]).all()
    assert (np.isnan(difference[1, :, 0]) == (replay.times > 80.5 * TIMESTEP)).all()
    assert 0.8 * NOISE < np.sqrt(np.nanmean(difference**2)) < 1.2 * NOISE
    assert replay.noise.tolist() == [NOISE, NOISE]


def test_hidden_friction_shows_in_the_misfit() -> None:
    """Above what noise explains, in every joint."""
    seen = watched(3, damping=0.05, faults=NOISY)
    estimate = fit(
        Readings([seen.read_trial(seen.nominal.lumps)], LogUnknowns(seen.nominal.lumps, GRAVITY)), restarts=0
    )
    assert estimate.misfit > 2.0


def test_windows_before_a_fall_are_used() -> None:
    """And pushes of which nothing was seen change nothing."""
    seen = watched(2, faults=NOISY)
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    trial = seen.read_trial(raised(seen.nominal.lumps, 1.5))
    trial = replace(trial, steps=np.array([len(trial.readings[0]) - 1, 80, 80, 0]))
    estimate = fit(Readings([trial], unknowns))
    error = estimate.unknowns - unknowns.log_factors(seen.plant.chain.lumps)
    assert (np.abs(error) < 4.0 * estimate.deviations).all()
    assert np.isnan(estimate.residuals[0][3]).all()
    assert 0.5 < estimate.misfit < 1.5
    with pytest.raises(ValueError, match="nothing to compare"):
        Readings([replace(trial, steps=np.zeros(4, dtype=np.int64))], unknowns)


def test_eliminating_start_speeds_is_the_same_as_searching_them() -> None:
    """The step of the other unknowns, and that of the start speeds that follows, are those of one least squares."""
    random = np.random.default_rng(2)
    npush, nvalue, count, speeds = 3, 8, 4, 2
    values, whitened = random.normal(size=(npush, nvalue)), random.normal(size=(npush, speeds))
    slopes = random.normal(size=(npush, nvalue, count + speeds))
    reduced = eliminated((values, slopes), whitened, npush)
    step = np.linalg.lstsq(reduced.slopes, -reduced.values)[0]

    whole = np.zeros((npush * (nvalue + speeds), count + npush * speeds))
    target = np.zeros(len(whole))
    for push in range(npush):
        rows, own = push * (nvalue + speeds), slice(count + push * speeds, count + (push + 1) * speeds)
        whole[rows : rows + nvalue, :count] = slopes[push, :, :count]
        whole[rows : rows + nvalue, own] = slopes[push, :, count:]
        whole[rows + nvalue : rows + nvalue + speeds, own] = np.eye(speeds)
        target[rows : rows + nvalue + speeds] = -np.concatenate([values[push], whitened[push]])
    expected = np.linalg.lstsq(whole, target)[0]
    assert np.allclose(step, expected[:count])
    assert np.allclose(reduced.following @ np.append(1.0, step), expected[count:])
