"""The nominal model's metric: what it promises of the landscape, measured on the landscape."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import random_plant

from metaid.compiled import Objective
from metaid.episode import Episode, pushed_speeds, rich_pushes, rich_speeds, tip_push
from metaid.errors import EpisodeError
from metaid.search import designed_speeds, nominal_metric, plain_coordinates, sensitivity


@pytest.mark.parametrize("nlink", [1, 2, 3, 5])
def test_spectral_measure_near_the_truth_is_what_the_sensitivity_says(nlink: int) -> None:
    """(2π f)² = δᵀ H δ for small errors δ of the factors, without H having seen a simulation."""
    plant, random = random_plant(nlink), np.random.default_rng(1)
    pushes = rich_pushes(plant, 2 * nlink, 4.0, seed=2)
    episode = Episode(pushes, 150)
    h = sensitivity(plant.chain, plant.gravity, pushed_speeds(plant, pushes), 150 * plant.timestep)
    objective = Objective(plant, plant.chain.lumps, episode, "spectral")
    for _ in range(5):
        error = random.normal(size=len(h)) * 1e-4
        value = objective.evaluate(1.0 + error).value
        assert (2 * np.pi * value) ** 2 == pytest.approx(error @ h @ error, rel=0.02)


def test_landscape_is_round_in_the_nominal_metric() -> None:
    """Steps of equal length in z raise the measure equally, in factors they do not."""
    plant = random_plant(3)
    pushes = rich_pushes(plant, 6, 4.0, seed=2)
    one = np.ones(6)
    speeds = pushed_speeds(plant, pushes)
    metric = nominal_metric(
        sensitivity(plant.chain, plant.gravity, speeds, 0.3), plain_coordinates(one, 0.5 * one, 2 * one)
    )
    objective = Objective(plant, plant.chain.lumps, Episode(pushes, 150), "spectral")

    def spread(coordinates) -> float:  # type: ignore[no-untyped-def]
        values = [objective.evaluate(coordinates.factors(1e-3 * step)).value for step in np.eye(6)]
        return max(values) / min(values)

    assert spread(metric) < 1.05
    assert spread(plain_coordinates(one, 0.5 * one, 2 * one)) > 3


def test_curvature_in_the_nominal_metric_is_what_the_measure_shows() -> None:
    """Near the truth the squared measure is κ times the squared distance in z."""
    plant, one = random_plant(3), np.ones(6)
    pushes = rich_pushes(plant, 6, 4.0, seed=2)
    h = sensitivity(plant.chain, plant.gravity, pushed_speeds(plant, pushes), 150 * plant.timestep)
    metric = nominal_metric(h, plain_coordinates(one, 0.5 * one, 2 * one))
    objective = Objective(plant, plant.chain.lumps, Episode(pushes, 150), "spectral")
    assert metric.curvature is not None
    for z in 1e-4 * np.random.default_rng(1).normal(size=(5, 6)):
        assert objective.evaluate(metric.factors(z)).value ** 2 == pytest.approx(metric.curvature * z @ z, rel=0.02)


def test_factors_and_coordinates_are_inverse_and_bounds_hold() -> None:
    """z → factors → z returns; beyond the bounds factors stop at them."""
    plant = random_plant(2)
    speeds = pushed_speeds(plant, rich_pushes(plant, 4, 4.0, seed=3))
    one = np.ones(3)
    metric = nominal_metric(
        sensitivity(plant.chain, plant.gravity, speeds, 0.3), plain_coordinates(one, 0.5 * one, 2 * one)
    )
    z = np.array([0.01, -0.02, 0.03])
    assert metric.z(metric.factors(z)) == pytest.approx(z)
    assert metric.inside(z)
    assert not metric.inside(100 * one)
    assert ((metric.factors(100 * one) >= 0.5) & (metric.factors(100 * one) <= 2)).all()
    low, high = metric.box()
    for i in range(3):
        for edge in (low, high):
            assert metric.inside((1 - 1e-9) * edge[i] * np.eye(3)[i])
            assert not metric.inside(1.001 * edge[i] * np.eye(3)[i])


def test_pushes_that_cannot_tell_lumps_apart_are_refused() -> None:
    """One push of four links at the tip moves too little to tell ten lumps apart."""
    plant = random_plant(4)
    one = np.ones(10)
    speeds = pushed_speeds(plant, tip_push(plant, 1e-3))
    with pytest.raises(EpisodeError, match="cannot tell all lumps apart"):
        nominal_metric(sensitivity(plant.chain, plant.gravity, speeds, 0.3), plain_coordinates(one, 0.5 * one, 2 * one))


@pytest.mark.parametrize("nlink", [2, 3, 5])
def test_designed_pushes_determine_the_least_determined_lump_better(nlink: int) -> None:
    """By the nominal model, the designed set has a smaller worst resolution than nearly every rich one."""
    chain = random_plant(nlink).chain

    def worst(speeds: np.ndarray) -> float:
        return float(np.diag(np.linalg.inv(sensitivity(chain, 9.81, speeds, 0.3))).max())

    designed = worst(designed_speeds(chain, 9.81, 2 * nlink, 4.0, 0.3, seed=1))
    rich = [worst(4.0 * rich_speeds(nlink, 2 * nlink, seed)) for seed in range(20)]
    assert sum(designed < other for other in rich) >= 19
