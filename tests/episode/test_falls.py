"""The fall rule, clause by clause, and the same in every loop.  Eq. 8."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import random_links, random_plant

from metaid.compiled import CompiledLoop, FaultyLoop, fastest_step
from metaid.episode import Episode, FallRule, Record, pushes_for, rich_pushes, run_stepwise, tip_push
from metaid.models import Lumps
from metaid.plant import FaultSettings, MujocoPlant, PlantSettings

RULE = FallRule(limit=1.5, margin=1.5)
TIMESTEP = 0.01


def fallen(angles: list[float], speeds: list[float]) -> bool:
    """Whether links at these absolute angles and speeds have, where none was faster than 1 rad/s after the push."""
    allowed = RULE.allowed_speeds(np.array([-1.0, 0.5]))
    return RULE.has_fallen(np.array(angles), np.array(speeds), allowed, TIMESTEP)


def test_link_past_the_limit_that_is_no_faster_than_the_margin_allows_coasts() -> None:
    """The truth may coast anywhere."""
    assert not fallen([0.1, 2.0], [0.5, 1.5])
    assert fallen([0.1, 2.0], [0.5, 1.6])
    assert fallen([-2.0, 0.1], [-1.6, 0.1])


def test_link_within_the_limit_may_be_fast() -> None:
    """Only past the limit does speed mean a fall."""
    assert not fallen([0.1, 1.4], [0.5, 90.0])


def test_link_that_turns_more_than_a_radian_in_a_step_has_fallen() -> None:
    """Wherever it is: a torque that is written once a step controls nothing any more."""
    assert not fallen([0.1, 0.1], [0.5, 1.0 / TIMESTEP])
    assert fallen([0.1, 0.1], [0.5, 1.01 / TIMESTEP])
    assert fallen([0.1, 0.1], [-1.01 / TIMESTEP, 0.5])


@pytest.mark.parametrize("state", [(np.nan, 1.0), (np.inf, 1.0), (0.1, np.nan), (0.1, np.inf), (np.nan, np.nan)])
def test_state_that_is_not_finite_has_fallen(state: tuple[float, float]) -> None:
    """A simulation that has diverged, or a rig that has stopped itself."""
    angle, speed = state
    assert fallen([angle, 0.1], [speed, 0.1])
    assert fallen([0.1, angle], [0.1, speed])


def in_every_loop(plant: MujocoPlant, candidate: Lumps, episode: Episode) -> list[Record]:
    """The episode on an ideal plant in each loop, those for plants with faults included."""
    faulty = FaultyLoop(plant, episode, fastest_step(plant))
    compiled = CompiledLoop(plant, episode).run(candidate)
    stepwise = [run_stepwise(each, candidate, episode)[0] for each in (plant, faulty.plant)]
    return [*stepwise, compiled, faulty.run(candidate)]


@pytest.mark.parametrize("turns", [(0.55, 0.95), (0.55, 1.05)])
def test_turn_of_more_than_a_radian_in_a_step_ends_the_episode_in_every_loop(turns: tuple[float, float]) -> None:
    """It is that of a link, not of a joint; here of links that coast, with a limit that nothing passes."""
    plant = random_plant(2)
    pushes = pushes_for(plant, np.array([turns]) / plant.timestep)
    episode = Episode(pushes, 5, FallRule(limit=1e9))
    records = in_every_loop(plant, plant.chain.lumps, episode)
    assert {record.fall_step for record in records} == {1 if max(turns) > 1.0 else None}


@pytest.mark.parametrize("margin", [1.5, 0.0])
def test_limit_and_margin_end_the_episode_at_the_same_step_in_every_loop(margin: float) -> None:
    """Of a candidate that falls and of the truth, which coasts past the limit and has fallen only without a margin."""
    plant = random_plant(1)
    episode = Episode(tip_push(plant, 1.0), 2000, FallRule(margin=margin))
    for factor, falls in ((1.0, margin == 0.0), (0.5, True)):
        records = in_every_loop(plant, plant.chain.lumps.scaled(np.array([factor])), episode)
        assert len({record.fall_step for record in records}) == 1
        assert (records[0].fall_step is not None) is falls


def test_link_that_runs_away_has_fallen_wherever_it_is() -> None:
    """Beyond its multiple of the fastest link's speed after the push; a rule without one waits for the limit."""
    rule = FallRule(limit=1.5, runaway=3.0)
    allowed = rule.allowed_speeds(np.array([-1.0, 0.5]))
    still = np.array([0.1, 0.1])
    assert not rule.has_fallen(still, np.array([0.5, -3.0]), allowed, TIMESTEP)
    assert rule.has_fallen(still, np.array([0.5, -3.01]), allowed, TIMESTEP)
    assert not fallen([0.1, 0.1], [0.5, -3.01])


def test_runaway_ends_the_episode_early_and_at_the_same_step_in_every_loop() -> None:
    """Of a candidate that falls; the truth and its neighbours are left alone."""
    plant = random_plant(3)
    pushes = rich_pushes(plant, 2, 0.5, seed=1)
    steps = []
    for rule in (FallRule(), FallRule(runaway=5.0)):
        records = in_every_loop(plant, plant.chain.lumps.scaled(np.full(6, 0.5)), Episode(pushes, 2000, rule))
        assert len({record.fall_step for record in records}) == 1
        steps.append(records[0].fall_step)
    assert steps[1] < 0.7 * steps[0]
    loop = CompiledLoop(plant, Episode(rich_pushes(plant, 6, 3.0, seed=1), 150, FallRule(runaway=5.0)))
    for factors in (np.ones(6), *np.random.default_rng(1).uniform(0.9, 1.1, (50, 6))):
        assert loop.run(plant.chain.lumps.scaled(factors)).fall_step is None


def test_step_in_which_a_radian_is_turned_is_that_of_the_control() -> None:
    """At 100 rad/s a plant has fallen whose torque is written every 20 ms, and not one where it is every 2 ms."""
    for control_every, fall_step in ((1, None), (10, 1)):
        settings = PlantSettings(links=random_links(1, 1), faults=FaultSettings(control_every=control_every))
        plant = MujocoPlant("slow", settings)
        episode = Episode(tip_push(plant, 100.0), 5, FallRule(limit=1e9))
        loop = FaultyLoop(plant, episode, fastest_step(plant))
        assert loop.run(plant.chain.lumps).fall_step == fall_step
        assert run_stepwise(loop.plant, plant.chain.lumps, loop.episode)[0].fall_step == fall_step
