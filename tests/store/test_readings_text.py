"""The sensor readings of a trial in the DB: exact, and as many as the budget holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import optuna
import pytest

from metaid.episode import SensorReadings, States, readings_before_fall
from metaid.store import Store
from metaid.store.motion import readings_of, readings_text
from metaid.study import Problem, create_study, load_study, run_study

pytestmark = pytest.mark.slow


def some_readings(ran: list[int], fell: bool, has_speed_sensor: bool) -> SensorReadings:
    """Up to five steps after three pushes of two joints, in numbers that no text shorter than their bits holds."""
    random = np.random.default_rng(1)
    motions = [States(*random.normal(size=(2, end + 1, 2)) * 10.0 ** random.integers(-200, 200)) for end in ran]
    falls = fell & (np.arange(3) == len(ran) - 1)
    return readings_before_fall(motions, 5, falls, has_speed_sensor)


@pytest.mark.parametrize("has_speed_sensor", [True, False])
@pytest.mark.parametrize(
    ("ran", "fell", "counts"), [([5, 5, 5], False, [6, 6, 6]), ([9, 4], True, [6, 4, 0]), ([1], True, [1, 0, 0])]
)
def test_text_holds_every_bit_of_what_was_read(
    ran: list[int], fell: bool, counts: list[int], has_speed_sensor: bool
) -> None:
    """Whole episodes and falls, without the reading of the fall itself, with and without a speed sensor."""
    readings = some_readings(ran, fell, has_speed_sensor)
    read = readings_of(readings_text(readings))
    assert read.counts.tolist() == readings.counts.tolist() == counts
    assert (read.angles == readings.angles).all()
    assert (read.speeds is None) == (not has_speed_sensor)
    if read.speeds is not None:
        assert readings.speeds is not None
        assert (read.speeds == readings.speeds).all()


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '{"counts": [1], "most": 6, "joints": 2}',
        '{"counts": [7], "most": 6, "joints": 2, "angles": ""}',
        '{"counts": [1], "most": 1000000000, "joints": 2, "angles": ""}',
        '{"counts": [1], "most": 6, "joints": 2, "angles": "AAAA"}',
    ],
)
def test_text_of_a_stranger_that_is_none_is_refused(text: str) -> None:
    """With an error that reading a DB answers in a line."""
    with pytest.raises((ValueError, TypeError, LookupError)):
        readings_of(text)


def test_trials_of_a_noisy_study_have_the_readings_that_the_law_acted_on(tmp_path: Path) -> None:
    """Those of the same episode run again, to the last bit, in an attribute that plain Optuna reads; no windows."""
    storage = str(tmp_path / "metaid.db")
    store, spec = Store(storage, create=True), load_study("noisy-three-link", {"trials": 3})
    create_study(store, spec)
    run_study(store, "noisy-three-link")
    objective = Problem(spec).make_objective()
    for trial in store.trials("noisy-three-link", spec.names):
        again = objective.record(trial.factors, trial.number)
        assert trial.outcome.windows is None
        assert trial.outcome.readings is not None
        assert (trial.outcome.readings.angles == np.array(again.angles)).all()
        assert trial.outcome.readings.speeds is None
    study = optuna.load_study(study_name="noisy-three-link", storage=f"sqlite:///{storage}")
    assert set(study.trials[0].user_attrs["readings"]) == {"counts", "most", "joints", "angles"}


def test_readings_end_with_the_budget_whoever_runs_the_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Which trials have them depends on their number alone, not on workers or on how often a run was stopped."""
    monkeypatch.setattr("metaid.study.problem.READING_BUDGET", 100_000)
    store = Store(str(tmp_path / "metaid.db"), create=True)
    spec = load_study("noisy-three-link", {"sampler": "cmaes", "trials": 20})
    kept = Problem(spec).trials_with_readings
    assert 0 < kept < 20
    for name, workers, stops in (("one", 1, (20,)), ("two", 2, (3, 13, 20))):
        create_study(store, spec, name)
        for stop in stops:
            run_study(store, name, trials=stop, workers=workers)
        trials = store.trials(name, spec.names)
        assert [trial.outcome.readings is not None for trial in trials] == [trial.number < kept for trial in trials]


def test_trials_that_no_estimate_is_made_of_keep_no_readings() -> None:
    """A study that stands by its estimate keeps those of more trials than one that stands by its best trial."""
    assert Problem(load_study("noisy-three-link", {"trials": 600})).trials_with_readings == 32
    assert Problem(load_study("noisy-three-link", {"sampler": "cmaes", "trials": 600})).trials_with_readings == 12
    assert Problem(load_study("three-link-coast")).trials_with_readings == 0
