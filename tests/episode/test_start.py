"""Pushes that begin elsewhere than upright, in every loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from analytic_chain import jacobians, simulate
from conftest import random_plant
from rig import rig_at

from metaid.compiled import CompiledLoop, FaultyLoop, Objective, agrees_with_stepwise, fastest_step
from metaid.episode import Episode, FallRule, rich_pushes, run_stepwise, same_record, spectral_hz, window_ends
from metaid.errors import EpisodeError, PlantError
from metaid.models import ChainModel
from metaid.plant import MujocoPlant, Start

ALL_SIZES = pytest.mark.parametrize("nlink", [1, 2, 3, 5])


def posed_episode(plant: MujocoPlant, count: int = 3, steps: int = 200) -> Episode:
    """Pushes from random poses; a pose has one joint at the upright, and nothing counts as a fall but a tumble."""
    poses = np.random.default_rng(8).uniform(-2.0, 2.0, (count, plant.njoint))
    poses[0, -1] = 0.0
    return Episode(rich_pushes(plant, count, 3.0, seed=1), steps, FallRule(limit=1e9), poses=poses)


@ALL_SIZES
def test_truth_coasts_from_any_pose(nlink: int) -> None:
    """Joint speeds stay what they were right after the push, in the compiled loop and step by step."""
    plant = random_plant(nlink)
    episode = posed_episode(plant)
    record, trajectory = run_stepwise(plant, plant.chain.lumps, episode)
    assert trajectory.angles[0].tolist() == episode.starts[-1].pose.tolist()
    assert np.abs(trajectory.speeds - trajectory.speeds[0]).max() < 1e-8
    assert np.abs(trajectory.speeds).max() > 0.1
    record = CompiledLoop(plant, episode).run(plant.chain.lumps)
    assert record.speed_energy.max() > 0.01
    assert spectral_hz(record.acceleration_energy, record.speed_energy) < 1e-6


@ALL_SIZES
def test_loops_agree_from_any_pose(nlink: int) -> None:
    """Angles, half periods, crossing times, energies and windows, off the truth, on plants with faults too."""
    plant = random_plant(nlink)
    episode = replace(posed_episode(plant), keep_angles=True, window_ends=window_ends(200))
    candidate = plant.chain.lumps.scaled(np.full(nlink * (nlink + 1) // 2, 1.3))
    expected, _ = run_stepwise(plant, candidate, episode)
    assert expected.fall_step is None
    for loop in (CompiledLoop(plant, episode), FaultyLoop(plant, episode, fastest_step(plant))):
        assert agrees_with_stepwise(loop, candidate, steps=200)
        record = loop.run(candidate)
        assert same_record(record, expected)
        assert record.crossing_span == pytest.approx(expected.crossing_span, abs=1e-6)
        for angles, others in zip(record.angles, expected.angles, strict=True):
            assert angles == pytest.approx(others, abs=1e-6)


def test_push_counts_as_a_crossing_only_of_a_joint_that_it_finds_upright() -> None:
    """A joint that begins elsewhere has its first crossing where it first passes the upright."""
    plant = random_plant(1)
    candidate = plant.chain.lumps.scaled(np.array([2.0]))
    counts = []
    for pose in (0.0, 0.3):
        episode = Episode(np.array([[0.05]]), 1500, FallRule(limit=1e9), poses=np.array([[pose]]))
        record = CompiledLoop(plant, episode).run(candidate)
        angles = run_stepwise(plant, candidate, replace(episode, keep_angles=True))[0].angles[0][:, 0]
        crossed = int((np.sign(angles[2:]) != np.sign(angles[1:-1])).sum())
        counts.append(record.half_periods[0, 0] - crossed)
    assert counts == [0, -1]


def test_impulses_act_at_the_tips_where_the_pose_has_them() -> None:
    """The speeds are those of Newton's equations: the impulse times the horizontal lever of each tip, at any pose."""
    plant, random = random_plant(3), np.random.default_rng(4)
    angles, impulses = random.uniform(-2.0, 2.0, 3), random.uniform(-0.2, 0.2, 3)
    absolute, chain = np.cumsum(angles), plant.chain
    first, _ = jacobians(chain, absolute)
    mass = np.einsum("bxi,bxj,b->ij", first, first, chain.mass) + np.diag(chain.inertia)
    levers = np.tril(np.ones((3, 3))) * (chain.length * np.cos(absolute))  # of link j, at the tip of link i
    expected = np.linalg.solve(mass, levers.T @ impulses)
    assert np.cumsum(plant.start_speeds(Start(impulses, angles))) == pytest.approx(expected)


def test_motion_from_a_pose_is_that_of_equations_written_independently() -> None:
    """Joint angles over 500 steps, with a law that is off."""
    plant = random_plant(2)
    candidate, episode = plant.chain.lumps.scaled(np.full(3, 1.2)), posed_episode(plant, 1, 500)
    _, trajectory = run_stepwise(plant, candidate, episode)
    law = lambda q, v: ChainModel(candidate, plant.gravity).torque(q, v)  # noqa: E731
    speeds = np.cumsum(plant.start_speeds(episode.starts[0]))
    expected = simulate(plant.chain, plant.gravity, plant.timestep, 500, speeds, law, np.cumsum(episode.starts[0].pose))
    assert np.abs(trajectory.angles - expected).max() < 1e-9


def test_objective_checks_its_loop_from_the_pose_of_the_first_push() -> None:
    """An episode with poses has the fast loop, and no warning."""
    plant = random_plant(2)
    objective = Objective(plant, plant.chain.lumps, posed_episode(plant), "spectral")
    assert type(objective._loop) is CompiledLoop
    assert objective.evaluate(np.ones(3)).value < 1e-6


def test_rig_is_not_pushed_from_a_pose() -> None:
    """Its protocol has impulses alone: one line says what is allowed, before anything is sent."""
    rig = rig_at("tcp://127.0.0.1:9")  # nothing listens there
    with pytest.raises(PlantError, match=r"joint angles \[0.0, 0.5\] rad \(allowed: 0 rad") as refused:
        rig.push(Start(np.array([0.1, 0.1]), np.array([0.0, 0.5])))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("poses", [np.zeros((1, 2)), np.zeros((2, 1)), np.array([[0.0, np.nan], [0.0, 0.0]])])
def test_poses_that_are_not_one_a_push_are_refused(poses: np.ndarray) -> None:
    """Of another number of pushes or joints, or not finite."""
    with pytest.raises(EpisodeError, match="poses: every push needs one"):
        Episode(np.full((2, 2), 0.1), 100, poses=poses)
