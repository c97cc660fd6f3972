"""Windows of a push: what every loop keeps of the motion, for an estimate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import random_links, random_plant

from metaid.compiled import CompiledLoop, FaultyLoop, fastest_step
from metaid.episode import Episode, StepwiseLoop, rich_pushes, run_stepwise, same_record, tip_push, window_ends
from metaid.plant import FaultSettings, MujocoPlant, PlantSettings


def test_windows_grow_to_the_horizon_and_end_with_it() -> None:
    """Each ends with a whole step, and short horizons have fewer of them."""
    assert window_ends(160, 5, 1 / 16) == (10, 20, 40, 80, 160)
    assert window_ends(3) == (1, 2, 3)
    assert window_ends(1) == (1,)


@pytest.mark.parametrize("nlink", [1, 3, 5])
def test_compiled_windows_are_those_of_the_motion_step_by_step(nlink: int) -> None:
    """Angles, speeds, both energies and half periods, at every window of every push."""
    plant = random_plant(nlink)
    episode = Episode(rich_pushes(plant, 3, 4.0, 7), 150, window_ends=window_ends(150))
    candidate = plant.chain.lumps.scaled(np.full(nlink * (nlink + 1) // 2, 1.3))
    one, (other, _) = CompiledLoop(plant, episode).run(candidate), run_stepwise(plant, candidate, episode)
    assert one.windows is not None
    assert one.windows.seen.tolist() == [5, 5, 5]
    assert same_record(one, other)
    assert one.windows.speed_energy[:, -1] == pytest.approx(one.speed_energy, rel=1e-12)
    assert one.windows.acceleration_energy[:, -1] == pytest.approx(one.acceleration_energy, rel=1e-12)
    assert (one.windows.half_periods[:, -1] == one.half_periods).all()


def test_windows_before_a_fall_are_kept_and_none_after_it() -> None:
    """The push that fell has the windows that had ended, those not begun have none; so in both loops."""
    plant = random_plant(2)
    episode = Episode(np.repeat(tip_push(plant, 0.1), 3, axis=0), 1500, window_ends=window_ends(1500))
    candidate = plant.chain.lumps.scaled(np.full(3, 0.9))
    compiled = CompiledLoop(plant, episode)
    compiled.run(plant.chain.lumps.scaled(np.full(3, 1.3)))
    one, (other, _) = compiled.run(candidate), run_stepwise(plant, candidate, episode)
    assert one.windows is not None
    assert one.fall_step is not None
    ended = sum(end < one.fall_step for end in episode.window_ends)
    assert 0 < ended < len(episode.window_ends)
    assert one.windows.seen.tolist() == [ended, 0, 0]
    assert one.windows.motion[0, :ended].any()
    assert not one.windows.motion[0, ended:].any()
    assert same_record(one, other)


def test_windows_of_a_plant_with_faults_are_what_its_sensors_read() -> None:
    """The compiled loop with faults keeps the same windows as the plain one, of readings and not of the motion."""
    faults = FaultSettings(angle_noise=1e-3, speed_sensor=False, control_every=2, delay=1)
    plant = MujocoPlant("noisy", PlantSettings(links=random_links(2, 3), faults=faults))
    episode = Episode(rich_pushes(plant, 2, 4.0, 7), 75, window_ends=window_ends(75))
    candidate = plant.chain.lumps.scaled(np.full(3, 1.3))
    compiled = FaultyLoop(plant, episode, fastest_step(plant))
    reference = StepwiseLoop(compiled.plant, compiled.episode)
    one, other = compiled.run(candidate), reference.run(candidate)
    assert one.windows is not None
    assert same_record(one, other)
    quiet = MujocoPlant("quiet", PlantSettings(links=random_links(2, 3)))
    assert np.abs(one.windows.angles - run_stepwise(quiet, candidate, episode)[0].windows.angles).max() > 1e-4  # type: ignore[union-attr]


def test_nothing_is_kept_unless_the_episode_asks_for_it() -> None:
    """An episode without window ends has a record without windows."""
    plant = random_plant(2)
    episode = Episode(rich_pushes(plant, 2, 4.0, 7), 50)
    assert CompiledLoop(plant, episode).run(plant.chain.lumps).windows is None
    assert run_stepwise(plant, plant.chain.lumps, episode)[0].windows is None
    assert CompiledLoop(plant, replace(episode, window_ends=(50,))).run(plant.chain.lumps).windows is not None
