"""The estimate that is kept with a study: exact, of its trials, and read without what fits or simulates."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import optuna
import pytest
from conftest import Finished

import metaid as package
from metaid.plant import FaultSettings, PlantSettings
from metaid.results import read_snapshot, summary
from metaid.results.overview import summarized
from metaid.store import Store
from metaid.study import create_study, load_study, run_study
from metaid.study.estimates import kept, kept_with

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]
CHAINS = "matched", "searched", "hidden", "hidden-searched", "noisy"
ARMS = "exact", "noisy", "bent"
HEAVY = ("mujoco", "numba", "scipy.optimize", "scipy.stats", "matplotlib", "cmaes", "ray")
NOISE = {"angle_noise": 1e-3, "speed_sensor": False}
# What a plant has, and what its study searches: a proposal, faults that are taken up, noisy torques.
FAULTS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "proposes": ({"delay": 2, "tilt": 0.01}, {"faults": ["delay"]}),
    "takes up": ({"delay": 4}, {"faults": "proposed"}),
    "noisy torques": ({"torque_noise": 0.05}, {}),
}


def refused(*_: Any) -> Any:
    """In place of a fit."""
    raise AssertionError("an estimate was made where one is kept")


def shown_of(snapshot: Any) -> str:
    """What `study show --json` says of a study."""
    return json.dumps(summarized(snapshot))


def same_either_way(storage: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """What is said of a study by the kept estimate, after it has been compared with what is said by one made anew."""
    with closing(Store(str(storage))) as store:
        snapshot = read_snapshot(store, name)
    anew = shown_of(replace(snapshot, kept=None))
    monkeypatch.setattr(kept, "_made", refused)
    assert shown_of(snapshot) == anew
    return anew


@pytest.fixture
def made(tmp_path: Path) -> Path:
    """A DB with `two`, a study of two links that has run."""
    with closing(Store(str(tmp_path / "metaid.db"), create=True)) as store:
        create_study(store, load_study("two-link-tpe", {"sampler": "output-error", "trials": 3}), "two")
        run_study(store, "two")
    return tmp_path / "metaid.db"


@pytest.mark.parametrize("name", CHAINS)
def test_kept_estimate_says_what_one_made_anew_says(
    name: str, estimated: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the last bit: lumps, intervals, misfit, what is missing, and how early it was there."""
    same_either_way(estimated, name, monkeypatch)


@pytest.mark.parametrize("name", ARMS)
def test_kept_estimate_of_an_arm_says_what_one_made_anew_says(
    name: str, arms: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that explains nothing, too, with what pushes that were left out say."""
    same_either_way(arms, name, monkeypatch)


@pytest.mark.parametrize("named", FAULTS)
def test_faults_and_noise_are_kept_with_the_estimate(
    named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that are proposed, taken up or searched, those that speak against them, and the noise of torques."""
    faults, searched = FAULTS[named]
    changes = {"sampler": "output-error", "trials": 1, "episode.measure": "smoothed"}
    spec = load_study("two-link-tpe", changes | {f"estimate.{key}": value for key, value in searched.items()})
    assert isinstance(spec.plant, PlantSettings)
    plant = spec.plant.model_copy(update={"faults": FaultSettings.model_validate(NOISE | faults)})
    with closing(Store(str(tmp_path / "metaid.db"), create=True)) as store:
        create_study(store, spec.model_copy(update={"plant": plant}), "faulty")
        run_study(store, "faulty")
        estimate = read_snapshot(store, "faulty").estimate
    assert estimate is not None
    seen = {
        "proposes": estimate.proposal,
        "takes up": estimate.taken_up,
        "noisy torques": estimate.estimate.torque_noise,
    }
    assert seen[named] is not None
    same_either_way(tmp_path / "metaid.db", "faulty", monkeypatch)


def test_nothing_that_reads_a_study_fits_it_again(
    metaid: Metaid, estimated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not show, model, validate, compare, list or the frames of Python."""
    monkeypatch.setattr(kept, "_made", refused)
    storage = str(estimated)
    metaid("study", "show", "matched", "--storage", storage)
    metaid("study", "model", "matched", "-o", str(tmp_path / "model.json"), "--storage", storage)
    metaid("study", "validate", "matched", "--pushes", "1", "--storage", storage)
    metaid("study", "compare", "matched", "searched", "--storage", storage)
    metaid("study", "list", "--storage", storage)
    assert package.study("matched", storage).estimate["determined"].all()


def test_trials_that_others_add_make_a_new_estimate(made: Path) -> None:
    """Readers make it and write nothing; the next run keeps it."""
    with closing(Store(str(made))) as store:
        before = kept_with(store, "two")
    objective = package.objective("two", str(made))
    optuna.load_study(study_name="two", storage=f"sqlite:///{made}").optimize(objective, n_trials=1)
    with closing(Store(str(made))) as store:
        shown = summary(store, "two")
        assert shown["estimate"]["by_others"] == 1
        assert kept_with(store, "two") == before
        run_study(store, "two")
        after = kept_with(store, "two")
        assert after["of"]["others"] == [shown["trials"]["total"]]
        assert summary(store, "two") == shown


def test_estimate_of_fewer_trials_is_not_that_of_a_study(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As after a kill between the last trial and the estimate: it is made anew, and kept by the next run."""
    with closing(Store(str(made))) as store:
        shown, whole = summary(store, "two"), kept_with(store, "two")
        store.set_attribute("two", kept.KEY, {**whole, "of": {**whole["of"], "trials": 1}}, shown=False)
        assert summary(store, "two") == shown
        run_study(store, "two")
        assert kept_with(store, "two") == whole
        monkeypatch.setattr(kept, "_code", lambda: "another version")
        assert summary(store, "two") == shown


@pytest.mark.parametrize("spoiled", [None, 1, [], {}, "text", {"estimate": "AAAA"}, {"estimate": 3}])
def test_what_is_no_estimate_is_made_anew(spoiled: Any, made: Path) -> None:
    """Whatever has been written in its place."""
    with closing(Store(str(made))) as store:
        shown, whole = summary(store, "two"), kept_with(store, "two")
        value = {**whole, **spoiled} if isinstance(spoiled, dict) and spoiled else spoiled
        store.set_attribute("two", kept.KEY, value, shown=False)
        assert summary(store, "two") == shown


def test_optuna_does_not_show_the_estimate(made: Path) -> None:
    """It is none of the study's user attributes, which its tools list."""
    study = optuna.load_study(study_name="two", storage=f"sqlite:///{made}")
    assert kept.KEY not in study.user_attrs


def test_show_of_a_study_that_has_ended_loads_nothing_that_simulates(
    estimated: Path, arms: Path, tmp_path: Path
) -> None:
    """Neither MuJoCo nor numba, nor what only a search or a figure needs: of chains, on a noisy plant too, and arms."""
    shown = []
    for storage, name in ((estimated, "matched"), (estimated, "noisy"), (arms, "exact")):
        shown.append(("study", "show", name, "--storage", str(shutil.copy(storage, tmp_path))))
    code = f"""
import sys
from metaid.cli import main
for command in {shown!r}:
    try:
        main(command)
    except SystemExit as end:
        assert not end.code
print([name for name in {HEAVY!r} if name in sys.modules])
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines()[-1] == "[]"
