"""The laws of physics that the method stands on, in the episode as it is run."""

from __future__ import annotations

import numpy as np
import pytest
from analytic_chain import simulate
from conftest import random_plant

from metaid.compiled import CompiledLoop, Objective
from metaid.episode import Episode, FallRule, crossing_hz, pushed_speeds, rich_pushes, run_stepwise, tip_push
from metaid.episode.record import crossings
from metaid.errors import EpisodeError
from metaid.models import ChainModel, factors_from_names
from metaid.plant import LinkSettings, MujocoPlant, PlantSettings

ALL_SIZES = pytest.mark.parametrize("nlink", [1, 2, 3, 5, 10])


def test_squared_frequency_is_proportional_to_over_compensation() -> None:
    """One link, small push: ω² ∝ f − 1 within 1 %, and the factor is g μ / d.  Eqs. 4 and 5."""
    plant = random_plant(1)
    objective = Objective(plant, plant.chain.lumps, Episode(tip_push(plant, 0.01), 20_000), "crossing")
    expected = plant.gravity * plant.chain.lumps.gravity[0] / plant.chain.inertia_lumps[0]
    for factor in (1.02, 1.05, 1.1, 1.3):
        record = objective.record(np.array([factor]))
        omega = 2 * np.pi * crossing_hz(record.half_periods, record.crossing_span)[0, 0]
        assert omega**2 / (factor - 1) == pytest.approx(expected, rel=0.01)


@ALL_SIZES
def test_exact_compensation_coasts_after_any_push(nlink: int) -> None:
    """At the truth joint speeds stay what they were right after the push, to 1e-9."""
    plant = random_plant(nlink)
    for seed in range(3):
        episode = Episode(rich_pushes(plant, 1, 4.0, seed), 1000, fall_rule=FallRule(1e9))
        _, trajectory = run_stepwise(plant, plant.chain.lumps, episode)
        assert np.abs(trajectory.speeds - trajectory.speeds[0]).max() < 1e-9
        assert len(trajectory.speeds) == 1001


@pytest.mark.parametrize(("nlink", "factor"), [(1, 1.1), (2, 1.2), (3, 1.1), (3, 0.9)])
def test_mujoco_agrees_with_equations_of_motion_written_independently(nlink: int, factor: float) -> None:
    """Joint angles over 2,000 steps equal those of Newton's equations for every body, to 1e-9."""
    plant = random_plant(nlink)
    candidate = plant.chain.lumps.scaled(np.full(nlink * (nlink + 1) // 2, factor))
    pushes = tip_push(plant, 0.05)
    _, trajectory = run_stepwise(plant, candidate, Episode(pushes, 2000, fall_rule=FallRule(1e9)))
    law = lambda q, v: ChainModel(candidate, plant.gravity).torque(q, v)  # noqa: E731
    expected = simulate(plant.chain, plant.gravity, plant.timestep, 2000, pushed_speeds(plant, pushes)[0], law)
    difference = np.abs(trajectory.angles - expected)
    assert (difference / np.maximum(1.0, np.abs(expected))).max() < 1e-9


@ALL_SIZES
@pytest.mark.parametrize("kind", ["rich", "tip"])
def test_compiled_loop_equals_plain_loop(nlink: int, kind: str) -> None:
    """Steps, fall, crossings and energies are the same in both loops, survivors and falls alike."""
    plant, random = random_plant(nlink), np.random.default_rng(6)
    pushes, steps = (rich_pushes(plant, 3, 4.0, 7), 150) if kind == "rich" else (tip_push(plant, 0.1), 1500)
    episode = Episode(pushes, steps)
    compiled = CompiledLoop(plant, episode)
    fell = 0
    for centre, spread in ((1.0, 0.0), (1.0, 0.01), (1.2, 0.1), (1.0, 0.4), (0.6, 0.0)):
        factors = centre + random.uniform(-spread, spread, nlink * (nlink + 1) // 2)
        candidate = plant.chain.lumps.scaled(factors)
        one, (other, _) = compiled.run(candidate), run_stepwise(plant, candidate, episode)
        assert (one.total_steps, one.fall_step) == (other.total_steps, other.fall_step)
        fell += one.fall_step is not None
        if one.fall_step is None:
            assert (one.half_periods == other.half_periods).all()
            for name in ("crossing_span", "speed_energy", "acceleration_energy"):
                assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-6, abs=1e-9)
    assert kind == "rich" or fell > 0


def test_kept_angles_are_those_of_the_plain_loop_and_end_at_the_fall() -> None:
    """A push that was not begun has none, the one that fell ends there, and nothing is kept unless asked for."""
    plant = random_plant(2)
    episode = Episode(np.repeat(tip_push(plant, 0.1), 3, axis=0), 1500, keep_angles=True)
    compiled = CompiledLoop(plant, episode)
    for factor, pushes in ((1.2, 3), (0.9, 1)):
        candidate = plant.chain.lumps.scaled(np.full(3, factor))
        one, (other, _) = compiled.run(candidate), run_stepwise(plant, candidate, episode)
        assert len(one.angles) == len(other.angles) == pushes
        for kept, expected in zip(one.angles, other.angles, strict=True):
            assert kept == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert sum(len(kept) - 1 for kept in one.angles) == one.total_steps
    assert CompiledLoop(plant, Episode(episode.pushes, 10)).run(candidate).angles == ()


def test_record_of_a_fall_shows_nothing_of_the_candidate_before() -> None:
    """Pushes that were not begun are zero, whatever was evaluated last: a trial must not depend on its worker."""
    plant = random_plant(2)
    compiled = CompiledLoop(plant, Episode(np.repeat(tip_push(plant, 0.1), 2, axis=0), 1500))
    falling = plant.chain.lumps.scaled(np.full(3, 0.9))
    fresh = compiled.run(falling).half_periods.copy()
    assert compiled.run(plant.chain.lumps.scaled(np.full(3, 1.3))).half_periods.sum() > 0
    assert (compiled.run(falling).half_periods == fresh).all()


def test_without_a_margin_a_link_past_the_limit_has_fallen_however_slow() -> None:
    """The fitted reading of the paper has such a rule; coasting truth falls by it."""
    plant = random_plant(1)
    fell = [
        CompiledLoop(plant, Episode(tip_push(plant, 1.0), 2000, FallRule(margin=margin)))
        .run(plant.chain.lumps)
        .fall_step
        for margin in (1.5, 0.0)
    ]
    assert fell[0] is None
    assert fell[1] == pytest.approx(np.pi / 2 / plant.timestep, abs=1)


def paper_plant(nlink: int) -> MujocoPlant:
    """The paper's plant as far as it can be known: 1 kg rods, g = 9.8 m/s², a 10 ms step (docs/paper.md)."""
    links = (LinkSettings(length=0.45, mass=1.0),) * nlink
    return MujocoPlant("paper", PlantSettings(gravity=9.8, timestep=0.01, links=links))


PAPER_ONE = [(factor, False) for factor in (1.10, 1.05, 1.04, 1.03, 1.02, 1.01, 1.00)] + [(0.99, True)]
PAPER_TWO = [((f, f, f), False) for f in (1.05, 1.04, 1.03, 1.02, 1.01)] + [
    ((1.00, 1.00, 1.01), False),
    ((1.00, 1.00, 1.00), False),
    ((0.99, 1.00, 1.00), False),
    ((0.99, 0.99, 1.00), True),
    ((0.99, 0.99, 0.99), True),
]


def growth(plant: MujocoPlant, factors: np.ndarray) -> tuple[bool, float]:
    """Whether the candidate falls after a push of 0.01 N s, and how much faster link 1 ever was than right after it."""
    impulses = np.zeros((1, plant.njoint))
    impulses[0, -1] = 0.01
    candidate = plant.chain.lumps.scaled(factors)
    record, trajectory = run_stepwise(plant, candidate, Episode(impulses, 5000))
    if record.fall_step is not None:  # it ended there
        _, trajectory = run_stepwise(plant, candidate, Episode(impulses, 5000, fall_rule=FallRule(1e9)))
    speeds = np.abs(trajectory.speeds[:, 0])
    return record.fall_step is not None, speeds.max() / speeds[0]


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "falls"), PAPER_ONE)
def test_falls_of_the_papers_first_table(factor: float, falls: bool) -> None:
    """One link falls where Table I says so, and link 1 gains speed there and nowhere else."""
    fell, gained = growth(paper_plant(1), np.array([factor]))
    assert fell == falls
    assert (gained > 10) == falls


@pytest.mark.slow
@pytest.mark.parametrize(("factors", "falls"), PAPER_TWO)
def test_falls_of_the_papers_second_table(factors: tuple[float, float, float], falls: bool) -> None:
    """Two links fall where Table II says so, (0.99, 1, 1), which does not, included."""
    named = dict(zip(("coriolis_1_2", "gravity_1", "gravity_2"), factors, strict=True))
    fell, gained = growth(paper_plant(2), factors_from_names(named, 2))
    assert fell == falls
    assert (gained > 10) == falls


def test_fall_ends_the_whole_episode_at_once() -> None:
    """After a fall in the first push, no later push is tried, and the step is the one that it survived to."""
    plant = random_plant(2)
    pushes = np.repeat(tip_push(plant, 0.1), 4, axis=0)
    record = CompiledLoop(plant, Episode(pushes, 3000)).run(plant.chain.lumps.scaled(np.full(3, 0.5)))
    assert record.fall_step is not None
    assert record.fall_step == record.total_steps < 3000


def test_crossing_times_lie_between_steps() -> None:
    """A sine that starts upright has its half periods and their time to a hundredth of a step."""
    timestep, hertz = 0.01, 1.234
    times = timestep * np.arange(501)
    half_periods, span = crossings(np.sin(2 * np.pi * hertz * times)[:, None], np.array([True]), timestep)
    assert half_periods[-1, 0] == 12
    assert half_periods[-1, 0] / (2 * span[0]) == pytest.approx(hertz, rel=1e-4)


@ALL_SIZES
def test_rich_pushes_give_every_link_speed_and_no_joint_too_little(nlink: int) -> None:
    """Link speeds are 0.3 to 1 of the peak, joint speeds at least 0.2 of it, on the plant itself."""
    plant = random_plant(nlink)
    speeds = pushed_speeds(plant, rich_pushes(plant, 8, 4.0, seed=9))
    assert np.abs(speeds).min() >= 0.3 * 4.0 * (1 - 1e-9)
    assert np.abs(speeds).max() <= 4.0 * (1 + 1e-9)
    assert np.abs(np.diff(speeds, axis=1, prepend=0.0)).min() >= 0.2 * 4.0 * (1 - 1e-9)


@pytest.mark.parametrize("pushes", [np.zeros((1, 2)), np.array([[0.1, np.nan]]), np.array([[0.1, 0.1], [0.0, 0.0]])])
def test_push_that_moves_nothing_is_refused(pushes: np.ndarray) -> None:
    """Without a push everything stays upright at frequency zero, which would pass for the truth."""
    with pytest.raises(EpisodeError, match="every push needs"):
        Episode(pushes, 100)
