"""Whole counts are matched to the last one, and what they leave open is told; or it is told that they are not."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from chain_studies import random_chain
from watched import TIMESTEP

from metaid.compiled import CompiledLoop
from metaid.episode import FALL_LIMIT, Episode, FallRule, even_ends, rich_pushes
from metaid.estimation import Estimate, LogUnknowns, WatchedTrial, upright
from metaid.models import Array
from metaid.paper.counting import Counts, match_counts, pairs
from metaid.plant import MujocoPlant, PlantSettings, chain_of

pytestmark = pytest.mark.slow

STEPS, WINDOWS, SPEED = 4000, 16, 0.1


@dataclass(frozen=True)
class Counting:
    """What a plant counted, the true log factors (nunknown), and the pushes."""

    counts: Counts
    truth: Array


def counting(nlink: int, candidates: int, seed: int = 0, damping: float = 0.0) -> Counting:
    """Small pushes of a random chain in MuJoCo under candidates that over-compensate; its joints may have `damping`."""
    true, believed = random_chain(nlink, seed)
    plant = MujocoPlant(
        "chain",
        PlantSettings(links=tuple(link.model_copy(update={"damping": damping}) for link in true), timestep=TIMESTEP),
    )
    pushes = rich_pushes(plant, 2 * nlink, SPEED, seed)
    loop = CompiledLoop(plant, Episode(pushes, STEPS, FallRule(FALL_LIMIT), window_ends=even_ends(STEPS, WINDOWS)))
    starts = np.array([plant.start_speeds(start) for start in loop.episode.starts])
    unknowns = LogUnknowns(chain_of(believed).lumps, plant.gravity)
    random = np.random.default_rng(seed)
    trials = []
    for _ in range(candidates):
        factors = np.ones(len(unknowns.nominal.vector))
        factors[:nlink] = random.uniform(1.6, 2.6, nlink)
        law = unknowns.nominal.scaled(factors)
        windows = loop.run(law).windows
        assert windows is not None
        trials.append(WatchedTrial(law, TIMESTEP, upright(starts), windows))
    truth = unknowns.log_factors(plant.chain.lumps)
    return Counting(Counts(trials, unknowns), truth)


@pytest.fixture(scope="module")
def two_links() -> Counting:
    return counting(2, 5, seed=3)


@pytest.fixture(scope="module")
def matched(two_links: Counting) -> Estimate:
    return match_counts(two_links.counts)


def test_twin_at_the_truth_counts_what_the_plant_counted(two_links: Counting) -> None:
    """In every window, push and joint; the plant is MuJoCo, and the phase says the same as the count."""
    counted = two_links.counts.counted(two_links.truth, WINDOWS)
    assert counted is not None
    assert counted.differing == 0
    assert counted.seen.max() > 10
    assert len(counted.seen) == 5 * 4 * WINDOWS * 2
    assert np.array_equal(np.floor(counted.turns), counted.shown)
    assert pairs(counted).violation == 0.0


def test_derivatives_of_phases_and_extrema_are_those_of_the_motion(two_links: Counting) -> None:
    """By differences of the unknowns, wherever no count changes meanwhile."""
    counts, change = two_links.counts, 1e-6
    here = counts.counted(two_links.truth, WINDOWS)
    assert here is not None
    for unknown in range(len(two_links.truth)):
        step = change * np.eye(len(two_links.truth))[unknown]
        more, less = (counts.counted(two_links.truth + sign * step, WINDOWS, slopes=False) for sign in (1.0, -1.0))
        assert more is not None
        assert less is not None
        turned = (more.turns - less.turns) / (2.0 * change)
        assert np.allclose(turned, here.slopes[:, unknown], rtol=1e-3, atol=1e-3)
        known = np.isfinite(here.touches)
        moved = (more.touches[known] - less.touches[known]) / (2.0 * change)
        assert np.mean(np.isclose(moved, here.touch_slopes[..., unknown][known], rtol=1e-2, atol=1e-2)) > 0.99


def test_whole_counts_give_all_lumps_of_two_links(two_links: Counting, matched: Estimate) -> None:
    """Coriolis and inertia lumps too, within 2 %, from masses wrong by up to 30 %; the truth is within the extent."""
    assert matched.misfit == 0.0
    assert matched.counts == 5 * 4 * WINDOWS * 2
    assert np.abs(np.expm1(matched.searched.design @ (matched.unknowns - two_links.truth))).max() < 0.02
    assert matched.extent is not None
    true = matched.searched.design @ two_links.truth
    assert (matched.extent[0] <= true).all()
    assert (true <= matched.extent[1]).all()
    assert np.abs(two_links.truth).max() > 0.1
    counted = two_links.counts.counted(matched.unknowns, WINDOWS)
    assert counted is not None
    assert counted.differing == 0


def test_fewer_counts_leave_more_open(two_links: Counting, matched: Estimate) -> None:
    """The extent of the set of models from two candidates is wider than that from five, of every lump."""
    fewer = match_counts(replace(two_links.counts, trials=two_links.counts.trials[:2]), matched.unknowns)
    assert fewer.misfit == 0.0
    assert fewer.extent is not None
    assert matched.extent is not None
    assert (np.diff(fewer.extent, axis=0) > np.diff(matched.extent, axis=0)).all()


def test_model_that_lacks_friction_is_said_not_to_count_the_same() -> None:
    """Hidden damping changes counts that no lumps make up for: some differ, and there is no extent."""
    damped = counting(2, 3, damping=0.02)
    found = match_counts(damped.counts, restarts=0)
    assert found.misfit >= 1.0
    assert found.extent is None


def test_joint_at_rest_after_a_push_is_not_compared(two_links: Counting) -> None:
    """Its first crossing is no half period, so its count and its phase would not be of the same."""
    trial = two_links.counts.trials[0]
    starts = trial.start_speeds.copy()
    starts[:, 1] = 0.0
    counted = replace(two_links.counts, trials=[replace(trial, starts=upright(starts))]).counted(two_links.truth, 1)
    assert counted is not None
    assert len(counted.seen) == 4


def test_every_joint_of_every_push_has_its_differing_counts(two_links: Counting) -> None:
    """They are none at the truth, and some at the nominal model."""
    exact, nominal = (np.stack(two_links.counts.by_joint(z)) for z in (two_links.truth, np.zeros(5)))
    assert exact.shape == nominal.shape == (5, 4, 2)
    assert not exact.any()
    assert nominal.any()
