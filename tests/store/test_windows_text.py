"""The windows of a trial in the DB: exact, compact, and as many as the budget holds."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import optuna
import pytest
from conftest import Finished

from metaid.episode import Windows, windows_before_fall
from metaid.store import Store
from metaid.store.motion import windows_of, windows_text
from metaid.study import Problem, create_study, load_study, run_study

Metaid = Callable[..., Finished]


def some_windows(ran: list[int], fell: bool, most: int) -> Windows:
    """Three pushes of two joints, with numbers that no shorter text than all their bits could hold."""
    random, ends = np.random.default_rng(1), np.array([3, 7, 20])
    motion = random.normal(size=(3, 3, 4, 2)) * 10.0 ** random.integers(-200, 200, (3, 3, 4, 2))
    half_periods, steps = random.integers(0, most + 1, (3, 3, 2)), np.array([*ran, 0, 0][:3])
    return windows_before_fall(ends, motion, half_periods, steps, fell & (np.arange(3) == len(ran) - 1))


@pytest.mark.parametrize(("ran", "fell"), [([20, 20, 20], False), ([20, 8], True), ([1], True)])
@pytest.mark.parametrize("most", [0, 200, 60_000])
def test_text_holds_every_bit_of_what_was_seen(ran: list[int], fell: bool, most: int) -> None:
    """Whole episodes and falls, counts that fit in a byte and such that do not."""
    windows = some_windows(ran, fell, most)
    read = windows_of(windows_text(windows))
    for name in ("ends", "seen", "motion", "half_periods"):
        assert (getattr(read, name) == getattr(windows, name)).all()


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"ends": [3], "seen": [1], "motion": "AAAA"}', '{"ends": [3], "seen": [1], "motion": 7}']
)
def test_text_of_a_stranger_that_is_none_is_refused(text: str) -> None:
    """With an error that reading a DB answers in a line."""
    with pytest.raises((ValueError, TypeError, LookupError)):
        windows_of(text)


def test_trials_of_three_links_have_windows_of_four_kilobytes_that_plain_optuna_reads(tmp_path: Path) -> None:
    """A user attribute like any other, and the same as the motion that was recorded."""
    storage = str(tmp_path / "metaid.db")
    store, spec = Store(storage, create=True), load_study("three-link-coast", {"trials": 12})
    create_study(store, spec)
    run_study(store, "three-link-coast")
    problem = Problem(spec)
    with_windows = store.trials("three-link-coast", spec.names)
    for trial in with_windows:
        again = problem.make_objective().record(trial.factors).windows
        assert again is not None
        assert trial.outcome.windows is not None
        assert (again.motion == trial.outcome.windows.motion).all()
    study = optuna.load_study(study_name="three-link-coast", storage=f"sqlite:///{storage}")
    sizes = [len(json.dumps(trial.user_attrs["windows"])) for trial in study.trials]
    assert max(sizes) < 4200
    assert set(study.trials[0].user_attrs["windows"]) >= {"ends", "seen", "motion"}


@pytest.mark.slow
def test_windows_end_with_the_budget_whoever_runs_the_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Which trials have them depends on their number alone, not on workers or on how often a run was stopped."""
    monkeypatch.setattr("metaid.study.problem.WINDOW_BUDGET", 35_000)
    store = Store(str(tmp_path / "metaid.db"), create=True)
    spec = load_study("three-link-coast", {"trials": 30})
    kept = Problem(spec).trials_with_windows
    assert 0 < kept < 30
    for name, workers, stops in (("one", 1, (30,)), ("two", 2, (5, 13, 30))):
        create_study(store, spec, name)
        for stop in stops:
            run_study(store, name, trials=stop, workers=workers)
        trials = store.trials(name, spec.names)
        assert [trial.outcome.windows is not None for trial in trials] == [trial.number < kept for trial in trials]
