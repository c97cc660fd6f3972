"""The study of `make demo`: noisy encoders, counted periods, a search from above, falls, a match of all trials."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import optuna
import pytest
from conftest import Finished, made_once

from metaid import results
from metaid.models import IDEAL, lump_names
from metaid.store import Store
from metaid.study import create_study, load_study, run_study

pytestmark = pytest.mark.slow

STUDY = "three-link"
CASES = ("cmaes", 1), ("cmaes", 2), ("tpe", 1)  # samplers and seeds; the first case is the shipped one


def run(folder: Path, **changes: Any) -> Store:
    """A DB in which the demonstration has been run."""
    store = Store(str(folder / "metaid.db"), create=True)
    create_study(store, load_study(STUDY, changes))
    run_study(store, STUDY)
    return store


@pytest.mark.parametrize(("sampler", "seed"), CASES)
def test_any_seed_counts_falls_and_finds_nine_lumps(
    demonstrated: Path, tmp_path: Path, sampler: str, seed: int
) -> None:
    """In 30 trials some candidates fall, most others swing through whole periods, and the match of them all has every
    gravity, Coriolis and inertia lump within 0.5 % and three standard deviations, though the best trial is far off.
    """
    is_shipped = (sampler, seed) == CASES[0]
    store = Store(str(demonstrated)) if is_shipped else run(tmp_path, sampler=sampler, seed=seed)
    shown, trials = results.summary(store, STUDY), results.trials_frame(store, STUDY)
    survivors = trials[trials["state"] == "COMPLETE"]
    counted = survivors.filter(like="periods_").sum(axis=1)
    assert len(trials) <= 30
    assert shown["trials"]["pruned"] >= 1
    assert (counted >= 1).mean() > 0.8
    assert shown["periods"] == counted.sum()
    assert (shown["verdict"], shown["source"]) == ("found", "estimate")
    assert [lump["name"] for lump in shown["lumps"]] == lump_names(3, (*IDEAL, "inertia"))
    assert all(lump["determined"] for lump in shown["lumps"])
    assert all(abs(lump["identified"] - lump["true"]) < 3.0 * lump["sd"] for lump in shown["lumps"])
    held = [lump["low"] <= lump["true"] <= lump["high"] for lump in shown["lumps"]]
    assert all(held) if is_shipped else sum(held) >= 7
    assert all(lump["high"] - lump["low"] > 2e-6 * lump["true"] for lump in shown["lumps"])
    assert shown["max_error"] < 5e-3
    assert shown["best"]["max_error"] > 0.1
    assert shown["estimate"]["known_from"] <= 12


def test_rounding_elsewhere_changes_neither_falls_nor_frequencies(tmp_path: Path) -> None:
    """A start that is moved by 1e-9, a million times what another processor's rounding does, moves no fall to another
    step, and frequencies by no more than a thousand times that.
    """
    tables = []
    for name, start in (("here", 1.4), ("there", 1.4 * (1.0 + 1e-9))):
        (tmp_path / name).mkdir()
        changes = {"search.start": start, "estimate.enabled": False}  # which changes no trial
        tables.append(results.trials_frame(run(tmp_path / name, **changes), STUDY))
    here, there = tables
    exact = ["state", "steps", "periods_1", "periods_2", "periods_3"]
    assert (here[exact] == there[exact]).all(axis=None)
    assert here["value"].to_numpy() == pytest.approx(there["value"].to_numpy(), rel=1e-6)


def test_end_says_how_many_periods_and_falls_and_how_early_the_answer_stood(metaid: Callable[..., Finished]) -> None:
    """What `metaid study run` prints last, and nothing but the name of the study before."""
    created = metaid("study", "create", STUDY)
    assert created.err == ""
    ended = " ".join(metaid("study", "run", STUDY, "--workers", "2").out.split())
    trials = results.trials_frame(Store("metaid.db"), STUDY)
    fell = (trials["state"] == "PRUNED").sum()
    counted = trials[trials["state"] == "COMPLETE"].filter(like="periods_").to_numpy().sum()
    assert f"{len(trials)} trials, {fell} of them falls; {counted} periods counted in the others" in ended
    assert "trials no lump moved by more than 0.1%; ± is half the 95 % interval" in ended
    assert "FOUND: 9 lumps, each to within" in ended


@pytest.mark.parametrize("draw", ["plot_optimization_history", "plot_parallel_coordinate", "plot_param_importances"])
def test_plain_optuna_draws_it(demonstrated: Path, draw: str) -> None:
    """Optuna alone opens the DB and makes its figures, falls as pruned trials."""
    mpl.use("agg")
    study = optuna.load_study(study_name=STUDY, storage=f"sqlite:///{demonstrated}")
    with mpl.rc_context():  # it sets a style for good, and other tests draw in this process
        assert getattr(optuna.visualization.matplotlib, draw)(study) is not None


def test_plain_optuna_has_the_same_best_trial_and_falls(demonstrated: Path) -> None:
    """A survivor is COMPLETE with its frequency; a fall is PRUNED with the step that it survived to."""
    study = optuna.load_study(study_name=STUDY, storage=f"sqlite:///{demonstrated}")
    shown = results.summary(Store(str(demonstrated)), STUDY)
    assert study.best_trial.number == shown["best"]["number"]
    assert study.best_value == shown["best"]["value"]
    fallen = study.get_trials(states=[optuna.trial.TrialState.PRUNED])
    assert len(fallen) == shown["trials"]["pruned"]
    assert all(trial.last_step == trial.user_attrs["steps"] < 6000 for trial in fallen)
    factors = [trial.params[f"gravity_{link}"] for trial in study.trials for link in (1, 2, 3)]
    assert np.median(factors) > 1.2  # it begins over-compensated


@pytest.fixture(scope="session")
def demonstrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A DB in which the demonstration has been run, not to be changed."""
    return made_once(tmp_path_factory, "demonstrated", lambda folder: run(folder).close()) / "metaid.db"
