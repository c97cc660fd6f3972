"""A candidate that could not be evaluated is a FAIL trial with its reason, and the study is as whole as any other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import optuna
import pytest
from conftest import Finished
from optuna.trial import TrialState

from metaid import results
from metaid.store import Store, Trial
from metaid.study import Problem, create_study, load_study

pytestmark = pytest.mark.slow

REASON = 'it ended its worker\'s process 3 times: "signal 6"'


@pytest.fixture
def database(tmp_path: Path) -> Path:
    """A study of two survivors, a fall and a failure."""
    path, spec = tmp_path / "metaid.db", load_study("two-link-tpe", {"episode.fall_limit": 1.0})
    store, problem = Store(str(path), create=True), Problem(spec)
    create_study(store, spec, "study")
    objective, factors = problem.make_objective(), [1.4, 0.5, 0.9, 1.2]
    batch = np.array([np.full(len(problem.names), factor) for factor in factors])
    outcomes = [objective.evaluate(candidate) for candidate in batch]
    assert [outcome.fell for outcome in outcomes] == [False, True, False, False]
    outcomes[2] = problem.failed(REASON)
    trials = [Trial(i, 0, *pair) for i, pair in enumerate(zip(batch, outcomes, strict=True))]
    store.append("study", problem.names, problem.low, problem.high, trials)
    assert [trial.outcome for trial in store.trials("study", problem.names)] == outcomes
    store.close()
    return path


def test_failure_is_worse_than_any_fall(database: Path) -> None:
    """The searcher is told a finite value beyond that of a fall at the first step."""
    problem = Problem(load_study("three-link-coast", {"episode.fall_limit": 1.0}))
    objective = problem.make_objective()
    worst_fall = objective.evaluate(np.full(len(problem.names), 0.01))
    assert worst_fall.fell
    assert worst_fall.value < problem.failed("").value < np.inf


def test_optuna_reads_a_failure_and_its_reason(database: Path) -> None:
    """FAIL, without a value, and the reason among the user attributes."""
    study = optuna.load_study(study_name="study", storage=f"sqlite:///{database}")
    states = [trial.state for trial in study.trials]
    assert states == [TrialState.COMPLETE, TrialState.PRUNED, TrialState.FAIL, TrialState.COMPLETE]
    assert study.trials[2].value is None
    assert study.trials[2].user_attrs["reason"] == REASON
    assert "reason" not in study.trials[1].user_attrs
    assert study.best_trial.number == 3


def test_tables_tell_failures_from_falls(database: Path, metaid) -> None:  # type: ignore[no-untyped-def]
    """The trial table has the state and no value; `study show` counts failures apart from falls."""
    store = Store(str(database))
    frame = results.trials_frame(store, "study")
    assert frame["state"].tolist() == ["COMPLETE", "PRUNED", "FAIL", "COMPLETE"]
    assert frame["value"].isna().tolist() == [False, False, True, False]
    assert results.summary(store, "study")["trials"] == {"total": 4, "complete": 2, "pruned": 1, "failed": 1}
    shown: Finished = metaid("study", "show", "study", "--storage", str(database))
    assert "4 trials, 1 of them falls, 1 failed;" in shown.out
    for kind in ("csv", "parquet", "html"):
        command = "report" if kind == "html" else "export"
        assert metaid("study", command, "study", "--storage", str(database), "-o", f"trials.{kind}").status == 0
