"""Episodes that are stopped after a push: what they show is what an episode of these pushes alone shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import random_links, random_plant

from metaid.compiled import Objective
from metaid.episode import Episode, Record, rich_pushes, run_stepwise, same_record, window_ends
from metaid.plant import FaultSettings, MujocoPlant, PlantSettings, Start

STEPS = 60


class CountedPlant(MujocoPlant):
    """A simulated plant that knows how often it was pushed."""

    pushes = 0

    def push(self, start: Start) -> None:
        self.pushes += 1
        super().push(start)


def four_pushes(plant: MujocoPlant) -> Episode:
    """Short ones, with windows."""
    return Episode(rich_pushes(plant, 4, 4.0, 7), STEPS, window_ends=window_ends(STEPS))


@pytest.mark.parametrize("measure", ["spectral", "crossing", "count"])
def test_stopped_episode_shows_what_one_of_its_pushes_alone_shows(measure: str) -> None:
    """The record, the value of the measure, the steps and the periods; it is asked after each push before."""
    plant = random_plant(2)
    whole, factors = four_pushes(plant), np.full(3, 1.4)
    objective = Objective(plant, plant.chain.lumps, whole, measure)
    asked: list[int] = []

    def goes_on(record: Record) -> bool:
        asked.append(record.total_steps)
        return record.total_steps < 2 * STEPS

    stopped = objective.evaluate(factors, goes_on=goes_on)
    short = Objective(plant, plant.chain.lumps, replace(whole, pushes=whole.pushes[:2]), measure).evaluate(factors)
    assert stopped == short
    assert asked == [STEPS, 2 * STEPS]
    assert stopped.windows is not None
    assert short.windows is not None
    assert stopped.windows.seen.tolist() == [*short.windows.seen.tolist(), 0, 0]
    assert (stopped.windows.motion[:2] == short.windows.motion).all()
    assert not stopped.windows.motion[2:].any()


@pytest.mark.parametrize("faults", [FaultSettings(), FaultSettings(angle_noise=1e-3)], ids=["ideal", "noisy"])
def test_loops_stop_alike(faults: FaultSettings) -> None:
    """The compiled loop, which runs all pushes and leaves some out, and the stepwise one, which does not push again."""
    plant = MujocoPlant("chain", PlantSettings(links=random_links(2, 1), faults=faults))
    objective = Objective(plant, plant.chain.lumps, four_pushes(plant), "spectral")
    factors = np.full(3, 1.4)
    compiled = objective.record(factors, 3, lambda record: record.total_steps < 3 * STEPS)
    stepwise, _ = run_stepwise(
        objective._loop.plant, plant.chain.lumps.scaled(factors), objective._loop.episode, 3,
        goes_on=lambda record: record.total_steps < 3 * STEPS,
    )  # fmt: skip
    assert compiled.total_steps == stepwise.total_steps == 3 * STEPS
    assert same_record(compiled, stepwise)


def test_plant_that_runs_step_by_step_is_not_pushed_after_it_was_stopped() -> None:
    """On a rig a push costs time."""
    plant = CountedPlant("counted", random_plant(2).settings)
    episode = four_pushes(plant)
    plant.pushes = 0
    run_stepwise(plant, plant.chain.lumps, episode, goes_on=lambda record: False)
    assert plant.pushes == 1


def test_push_that_ended_in_a_fall_is_not_asked_about() -> None:
    """The episode is over then, and its record is that of the fall."""
    plant = random_plant(2)
    episode = Episode(np.repeat(rich_pushes(plant, 1, 0.5, 7), 3, axis=0), 1500)
    objective = Objective(plant, plant.chain.lumps, episode, "spectral")
    asked: list[int] = []

    def goes_on(record: Record) -> bool:
        asked.append(record.total_steps)
        return True

    assert objective.evaluate(np.full(3, 0.7), goes_on=goes_on).fell
    assert asked == []
