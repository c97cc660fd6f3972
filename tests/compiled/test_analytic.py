"""The analytic equations of motion: an independent check of MuJoCo, and a screen whose result MuJoCo verifies."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import Finished, random_links

from metaid import results
from metaid.compiled.loop import CompiledLoop, fastest_step
from metaid.episode.episode import Episode
from metaid.episode.measures import spectral_hz
from metaid.episode.pushes import rich_pushes, tip_push
from metaid.plant.mujoco_plant import MujocoPlant
from metaid.plant.settings import PlantSettings
from metaid.store.database import Store
from metaid.study.create import create_study
from metaid.study.kinds import load_chain_study
from metaid.study.run import run_study

SCREENED = {"episode.physics": "analytic", "trials": 90}


@pytest.mark.parametrize("damping", [0.0, 0.02])
@pytest.mark.parametrize("nlink", [1, 2, 3, 5, 10])
def test_mujoco_and_the_analytic_equations_agree(nlink: int, damping: float) -> None:
    """Counts are equal, falls are at the same step, and energies agree to eight digits, with friction and without."""
    links = tuple(link.model_copy(update={"damping": damping}) for link in random_links(nlink, nlink))
    plant = MujocoPlant("chain", PlantSettings(links=links))
    lumps, random = plant.chain.lumps, np.random.default_rng(1)
    pushes = np.vstack([rich_pushes(plant, 2, 3.0, seed=2), tip_push(plant, 0.1)])
    episode = Episode(pushes, steps=300)
    engines = [CompiledLoop(plant, episode, fastest_step(plant, physics)) for physics in ("mujoco", "analytic")]
    for centre, spread in ((1.3, 0.1), (1.0, 0.1), (0.5, 0.2)):
        candidate = lumps.scaled(random.uniform(centre - spread, centre + spread, len(lumps.vector)))
        one, other = (engine.run(candidate) for engine in engines)
        assert one.fall_step == other.fall_step
        if one.fall_step is None:
            assert (one.half_periods == other.half_periods).all()
            assert np.allclose(one.speed_energy, other.speed_energy, rtol=1e-8)
            assert np.allclose(one.acceleration_energy, other.acceleration_energy, rtol=1e-8)


def test_exact_compensation_coasts_in_the_analytic_equations_too() -> None:
    """Torque and dynamics cancel, so nothing accelerates."""
    plant = MujocoPlant("chain", PlantSettings(links=random_links(5, 3)))
    episode = Episode(rich_pushes(plant, 10, 2.0, seed=1), steps=200)
    record = CompiledLoop(plant, episode, fastest_step(plant, "analytic")).run(plant.chain.lumps)
    assert spectral_hz(record.acceleration_energy, record.speed_energy) < 1e-6


@pytest.fixture
def screened(tmp_path: Path) -> Store:
    """A study DB with one study, `study`, that was screened with analytic physics."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, load_chain_study("three-link-coast", SCREENED), "study")
    run_study(store, "study")
    return store


def test_what_was_screened_is_reported_with_what_mujoco_says_of_it(
    screened: Store, metaid: Callable[..., Finished]
) -> None:
    """The best candidate has MuJoCo's own value beside it, and `show` says that it is verified."""
    best = results.summary(screened, "study")["best"]
    assert best["mujoco"]["agrees"]
    assert best["mujoco"]["value"] == pytest.approx(best["value"], rel=1e-6)
    shown = metaid("study", "show", "study", "--storage", screened.url)
    assert "verified" in " ".join(shown.out.split())


def test_what_mujoco_contradicts_is_reported_as_not_verified(screened: Store, metaid: Callable[..., Finished]) -> None:
    """A best value that MuJoCo does not reproduce is shown for what it is."""
    with sqlite3.connect(screened.url.removeprefix("sqlite:///")) as connection:
        connection.execute("UPDATE trial_values SET value = 0 WHERE trial_id = 1")
    best = results.summary(screened, "study")["best"]
    assert best["number"] == 0
    assert not best["mujoco"]["agrees"]
    shown = metaid("study", "show", "study", "--storage", screened.url)
    assert "NOT VERIFIED" in " ".join(shown.out.split())


def test_mujocos_own_studies_are_reported_as_before(tmp_path: Path) -> None:
    """There is nothing to verify where MuJoCo was searched with."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, load_chain_study("three-link-coast"), "study")
    run_study(store, "study", trials=9)
    assert "mujoco" not in results.summary(store, "study")["best"]
