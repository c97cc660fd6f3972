"""A law that asks for springs: joints that swing where they would coast."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import random_plant, rubbing_plant

from metaid.compiled import Objective
from metaid.episode import Episode, rich_pushes, run_stepwise
from metaid.plant import MujocoPlant


@pytest.mark.parametrize("plant", [random_plant(1), random_plant(3), rubbing_plant(5)], ids=["1", "3", "damped 5"])
def test_every_joint_swings_at_the_root_of_the_stiffness(plant: MujocoPlant) -> None:
    """With all lumps exact a joint is where it started after each period, and in between follows the sinusoid."""
    stiffness, period = 400.0, 2 * np.pi / 20.0
    steps = round(3 * period / plant.timestep)
    lumps = plant.chain.lumps_of((*plant.chain.kinds, "inertia"))
    episode = Episode(rich_pushes(plant, 1, 3.0, seed=1), steps, stiffness=stiffness)
    record, seen = run_stepwise(plant, lumps, episode)
    times = plant.timestep * np.arange(steps + 1)
    expected = seen.speeds[0] / 20.0 * np.sin(20.0 * times)[:, None]
    assert np.abs(seen.angles - expected).max() < 0.05 * np.abs(expected).max()  # the step is 1/25 of a radian
    assert (record.half_periods >= 5).all()
    crossings = record.half_periods / record.crossing_span / 2.0
    assert crossings == pytest.approx(20.0 / (2 * np.pi), rel=1e-3)


@pytest.mark.parametrize("timestep", [0.0005, 0.002, 0.008])
def test_truth_deviates_by_nothing_however_long_the_step(timestep: float) -> None:
    """The deviation is taken over a step from the state at its start, so Euler's own error is none of it."""
    plant = rubbing_plant(3, timestep=timestep)
    lumps = plant.chain.lumps_of((*plant.chain.kinds, "inertia"))
    episode = Episode(rich_pushes(plant, 6, 3.0, seed=1), round(0.3 / timestep), stiffness=400.0)
    objective = Objective(plant, lumps, episode, "spectral")
    assert objective.evaluate(np.ones(len(lumps.vector))).value < 1e-6
