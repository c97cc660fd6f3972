"""The measure that stands noise: exact on the curves it fits, fair on noise alone, and good enough to identify with."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
from conftest import Finished, random_plant

from metaid.compiled import Objective
from metaid.episode import RICH_FALL_LIMIT, Episode, FallRule, Outcome, noise_floor, rich_pushes
from metaid.episode.smoothing import smooth_energies, smoothed_hz
from metaid.errors import StudyError
from metaid.models import Array
from metaid.results import identified_factors
from metaid.results.best import known_by_best
from metaid.store import Trial
from metaid.study import Problem, identifiability_by_measure, load_study

pytestmark = pytest.mark.slow

PERIOD = 0.002
TIMES = PERIOD * np.arange(151)[:, None]


def test_energies_are_exact_on_a_cubic_through_the_upright() -> None:
    """∫ q̇² and ∫ q̈² of c₀ + c₁ t + c₃ t³, whatever the zero of the encoder is."""
    line, cube, horizon = np.array([2.0, -1.0, 0.5]), np.array([3.0, 0.0, -4.0]), TIMES[-1, 0]
    angles = 0.1 + line * TIMES + cube * TIMES**3
    speed_energy, acceleration_energy = smooth_energies(angles[None], PERIOD)
    expected = line**2 * horizon + 2.0 * line * cube * horizon**3 + 1.8 * cube**2 * horizon**5
    assert speed_energy[0] == pytest.approx(expected)
    assert acceleration_energy[0] == pytest.approx(12.0 * cube**2 * horizon**3, abs=1e-9)


def test_coasting_is_zero_and_nothing_at_all_is_zero() -> None:
    """Straight lines have no frequency, and a plant whose readings never change none either."""
    assert smoothed_hz((1.5 * TIMES)[None], PERIOD, 0.0) == pytest.approx(0.0, abs=1e-9)
    assert smoothed_hz(np.zeros((2, 151, 3)), PERIOD, 0.0) == 0.0


def test_it_agrees_with_spectral_where_there_is_no_noise() -> None:
    """Near the truth of an ideal plant both see the same accelerations."""
    plant = random_plant(3)
    episode = Episode(rich_pushes(plant, 6, 3.5, seed=2), 140, FallRule(RICH_FALL_LIMIT))
    spectral, smoothed = (Objective(plant, plant.chain.lumps, episode, name) for name in ("spectral", "smoothed"))
    random = np.random.default_rng(0)
    for _ in range(5):
        factors = 1.0 + 0.02 * random.standard_normal(6)
        assert smoothed.evaluate(factors).value == pytest.approx(spectral.evaluate(factors).value, rel=0.15)


def test_noise_floor_is_what_noise_adds_and_its_spread_how_much_that_varies() -> None:
    """Coasting with noise has a measure of zero on average once the floor is subtracted, and scatters as it says."""
    random, speeds = np.random.default_rng(3), np.array([[2.0, -1.0], [1.0, 1.5], [-2.0, 0.5]])
    floor = noise_floor(1e-3 * random.standard_normal((400, 151, 2)), PERIOD, speeds)
    lines = speeds[:, None, :] * TIMES
    squares = []
    for _ in range(400):
        value = smoothed_hz(lines + 1e-3 * random.standard_normal(lines.shape), PERIOD, floor.energy)
        squares.append(np.sign(value) * value**2)
    assert np.mean(squares) == pytest.approx(0.0, abs=0.2 * floor.frequency**2)
    assert np.std(squares) == pytest.approx(floor.spread**2, rel=0.2)


def test_differences_from_step_to_step_drown_in_noise_that_smooth_curves_stand() -> None:
    """A model that is wrong by 5 % is told from the truth by `smoothed` and not by `spectral`."""
    ratios = {}
    for measure in ("smoothed", "spectral"):
        objective = Problem(load_study("noisy-three-link", {"episode.measure": measure})).make_objective()
        truth = objective.plant.true_lumps()
        assert truth is not None
        exact = truth.vector / objective.nominal.vector
        values = [objective.evaluate(factor * exact).value for factor in (1.0, 1.05)]
        ratios[measure] = values[1] / max(values[0], 1e-9)
    assert ratios["spectral"] < 1.5
    assert ratios["smoothed"] > 5.0


@pytest.mark.parametrize("seed", [1, 2])
def test_gravity_lumps_are_within_two_percent_with_a_milliradian_of_noise(
    metaid: Callable[..., Finished], seed: int
) -> None:
    """Angles alone, and noisy: three links are identified, from a model that is wrong by 30 %; the ranges hold the
    truth.
    """
    cmaes = "--set", "sampler=cmaes", "--set", "trials=60"
    metaid("study", "create", "noisy-three-link", *cmaes, "--set", f"seed={seed}")
    assert "noise floor 0.00" in " ".join(metaid("study", "run", "noisy-three-link", "--quiet").out.split())
    shown = json.loads(metaid("study", "show", "noisy-three-link", "--json").out)
    gravity = shown["lumps"][:3]
    assert max(abs(lump["error"]) for lump in gravity) < 0.02
    assert all(lump["low"] < lump["identified"] < lump["high"] for lump in shown["lumps"])
    assert sum(lump["low"] <= lump["true"] <= lump["high"] for lump in shown["lumps"]) >= 5
    assert 0.0005 < shown["noise_floor_hz"] < 0.005


def test_repeats_average_the_noise() -> None:
    """Four times the pushes, half the spread of the square; the pushes are the same ones again."""
    weak = {"episode.peak_speed": 1.0}  # so that noise sets the resolution
    once, often = (Problem(load_study("noisy-three-link", {"episode.repeats": repeats, **weak})) for repeats in (1, 4))
    assert (often.episode.pushes == np.tile(once.episode.pushes, (4, 1))).all()
    ratio = (often.episode.noise_floor.spread / once.episode.noise_floor.spread) ** 2
    assert ratio == pytest.approx(0.5, rel=0.01)
    assert often.resolution < once.resolution


def test_long_pushes_are_refused() -> None:
    """One curve does not fit an oscillation of five thousand steps."""
    with pytest.raises(StudyError, match="allowed: rich pushes"):
        load_study("noisy-three-link", {"episode.pushes": "tip"})


def test_friction_is_refused_for_it_is_even_in_time() -> None:
    """A joint that is slowed by friction accelerates at once, which an odd curve does not see."""
    changes = {"search.lumps": ["gravity", "coriolis", "damping"]}
    with pytest.raises(StudyError, match="'smoothed' does not see friction"):
        load_study("noisy-three-link", changes)


def survivors_of(factors: Array, values: Array) -> list[Trial]:
    """Trials that survived, with these `factors` (ntrial x nlump) and `values` of the measure (ntrial)."""
    return [
        Trial(number, 0, each, Outcome(value, False, 1, (0,) * 3))
        for number, (each, value) in enumerate(zip(factors, values.tolist(), strict=True))
    ]


def test_identified_lumps_are_means_over_the_range_not_the_luckiest_trial() -> None:
    """Trials that noise takes below zero are as good as each other; those of a smooth measure are not."""
    problem = Problem(load_study("noisy-three-link"))
    factors = np.array([[1.0] * 6, [1.2] * 6, [1.1] * 6, [3.0] * 6])
    values = np.array([-3.0, 0.5, 0.0, 5.0]) * problem.resolution
    assert identified_factors(problem, factors, values) == pytest.approx(np.full(6, 1.1))
    known, nominal = known_by_best(problem, survivors_of(factors, values)), problem.robot.lumps.vector
    np.testing.assert_allclose(known.values, 1.1 * nominal)
    assert (known.low <= nominal).all()
    assert (known.high >= 1.2 * nominal).all()
    spectral = Problem(load_study("three-link-coast"))
    assert identified_factors(spectral, factors, values - values.min()).tolist() == [1.0] * 6


def test_range_is_at_least_as_wide_as_the_pushes_are_sensitive() -> None:
    """One trial alone has no range of its own: 1.5 times the resolution, and the more the larger its value is."""
    problem = Problem(load_study("three-link-coast"))
    resolution, nominal = identifiability_by_measure(problem).resolution, problem.robot.lumps.vector
    for multiple in (0.0, 2.0):
        values = np.array([multiple * problem.resolution])
        known = known_by_best(problem, survivors_of(np.ones((1, 6)), values))
        reach = 1.5 * resolution * (multiple + 1.0)
        np.testing.assert_allclose(known.high, nominal * (1.0 + reach))
        np.testing.assert_allclose(known.low, nominal * (1.0 - reach))
