"""A study as a plain Optuna objective: any sampler and pruner of Optuna's, and what metaid makes of the trials."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import optuna
import pandas as pd
import pytest
from optuna.pruners import BasePruner, MedianPruner, NopPruner
from optuna.samplers import BaseSampler, CmaEsSampler, GPSampler, QMCSampler, RandomSampler, TPESampler
from optuna.trial import FixedTrial, FrozenTrial, TrialState

import metaid
from metaid import results
from metaid.errors import StorageError, StudyError
from metaid.store import Store
from metaid.study import Problem, create_study, load_study, run_study

STUDY = "two-link-tpe"
SAMPLERS: dict[str, Callable[[], BaseSampler]] = {
    "tpe": lambda: TPESampler(seed=1),
    "cmaes": lambda: CmaEsSampler(seed=1, warn_independent_sampling=False),
    "gp": lambda: GPSampler(seed=1),
    "qmc": lambda: QMCSampler(seed=1),
}


class PruneAll(BasePruner):
    """Ends every trial at its first report."""

    def prune(self, study: optuna.Study, trial: FrozenTrial) -> bool:
        return True


@pytest.fixture(autouse=True)
def _quiet() -> None:
    optuna.logging.set_verbosity(optuna.logging.WARNING)


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_sampler_of_optunas_optimizes_a_study(sampler: str) -> None:
    """A survivor is COMPLETE with the measure's value, a fall PRUNED at the step that it survived to."""
    if sampler == "gp":
        pytest.importorskip("torch", reason="Optuna's GPSampler needs torch")
    spec = load_study(STUDY, {"episode.fall_limit": 0.95, "episode.fall_margin": 1.0, "search.high": 1.3})
    study = optuna.create_study(sampler=SAMPLERS[sampler](), pruner=NopPruner())
    study.optimize(metaid.objective(spec), 12)
    assert {trial.state for trial in study.trials} == {TrialState.COMPLETE, TrialState.PRUNED}
    for trial in study.trials:
        outcome = metaid.evaluate(spec, trial.params)
        assert trial.value == (None if outcome.fell else outcome.value)
        assert trial.user_attrs.get("fall_value") == (outcome.value if outcome.fell else None)
        assert trial.state == (TrialState.PRUNED if outcome.fell else TrialState.COMPLETE)
        assert trial.user_attrs["steps"] == max(trial.intermediate_values) == outcome.steps
        assert [trial.user_attrs[f"periods_{i}"] for i in (1, 2)] == list(outcome.periods)


def test_trial_reports_the_value_of_the_pushes_so_far() -> None:
    """One value a push, at the step that was reached; the last is the trial's."""
    study = optuna.create_study(sampler=RandomSampler(seed=1))
    objective = metaid.objective(STUDY)
    study.enqueue_trial(objective.start)
    study.optimize(objective, 1)
    (trial,), episode = study.trials, Problem(objective.spec).episode
    reported = trial.intermediate_values
    assert list(reported) == [episode.steps * push for push in range(1, len(episode.pushes) + 1)]
    assert reported[episode.total_steps] == trial.value
    assert len(set(reported.values())) == len(reported)


def test_pruner_ends_a_trial_after_the_push_that_it_has_seen() -> None:
    """Its motion is that of this push, and its steps are; a survivor among 20 by the median is pruned as well."""
    study = optuna.create_study(sampler=RandomSampler(seed=1), pruner=PruneAll())
    objective = metaid.objective(STUDY)
    study.enqueue_trial(objective.start)
    study.optimize(objective, 1)
    (trial,), episode = study.trials, Problem(objective.spec).episode
    assert trial.state == TrialState.PRUNED
    assert list(trial.intermediate_values) == [episode.steps]
    assert trial.user_attrs["steps"] == episode.steps
    assert trial.user_attrs["windows"]["seen"] == [len(episode.window_ends), *[0] * (len(episode.pushes) - 1)]
    study = optuna.create_study(sampler=RandomSampler(seed=1), pruner=MedianPruner(n_startup_trials=2))
    study.optimize(objective, 20)
    stopped = [each for each in study.trials if each.state == TrialState.PRUNED and each.value is not None]
    assert any(not metaid.evaluate(STUDY, each.params).fell for each in stopped)


def test_estimate_from_an_optuna_study_in_memory_has_all_lumps() -> None:
    """Trials of others carry what the estimate needs, falls and pruned ones included."""
    study = optuna.create_study(sampler=TPESampler(seed=1), pruner=MedianPruner(n_startup_trials=2))
    study.optimize(metaid.objective(STUDY), 10)
    assert {trial.state for trial in study.trials} == {TrialState.COMPLETE, TrialState.PRUNED}
    lumps = metaid.study(study).estimate
    assert len(lumps) == 5
    assert lumps["error"].abs().max() < 1e-9


@pytest.mark.slow
def test_optuna_study_in_a_db_is_shown_and_run_on(tmp_path: Path) -> None:
    """It has the settings of the objective, so metaid's own trials join those of Optuna."""
    path = tmp_path / "metaid.db"
    study = optuna.create_study(study_name="mine", storage=f"sqlite:///{path}", sampler=RandomSampler(seed=1))
    study.optimize(metaid.objective(STUDY), 4)
    shown = metaid.summary("mine", str(path))
    assert shown["verdict"] == "found"
    assert shown["source"] == "estimate"
    assert shown["max_error"] < 1e-9
    assert [trial["value"] for trial in shown["foreign_trials"]] == [trial.value for trial in study.trials]
    metaid.run(STUDY, "mine", str(path), trials=8)
    after = metaid.summary("mine", str(path))
    assert (after["trials"]["total"], after["estimate"]["trials"], after["estimate"]["by_others"]) == (8, 12, 4)
    assert metaid.objective("mine", str(path)).spec == load_study(STUDY)


@pytest.mark.slow
def test_asked_and_told_trials_join_the_estimate_and_leave_a_resume_as_it_would_be(tmp_path: Path) -> None:
    """metaid's own trials are those of a study that was left alone."""
    tables = []
    for name in ("alone", "shared"):
        path = tmp_path / f"{name}.db"
        with closing(Store(str(path), create=True)) as store:
            create_study(store, load_study(STUDY, {"trials": 24}), "study")
            run_study(store, "study", trials=8)
            alone = results.summary(store, "study")
            if name == "shared":
                study = optuna.load_study(
                    study_name="study", storage=f"sqlite:///{path}", sampler=RandomSampler(seed=3)
                )
                objective = metaid.objective("study", str(path))
                for _ in range(3):
                    trial = study.ask()
                    try:
                        study.tell(trial, objective(trial))
                    except optuna.TrialPruned:
                        study.tell(trial, state=TrialState.PRUNED)
                shown = results.summary(store, "study")
                assert shown["estimate"]["trials"] == alone["estimate"]["trials"] + 3
                assert shown["estimate"]["explains"]
                assert len(shown["foreign_trials"]) == 3
            run_study(store, "study")
            tables.append(results.trials_frame(store, "study"))
    pd.testing.assert_frame_equal(*tables, check_exact=True)


@pytest.mark.slow
def test_trials_of_other_settings_and_copies_are_not_in_the_estimate(tmp_path: Path) -> None:
    """Pushes of another seed are others; a copy shows nothing new; and text that is no motion is passed over."""
    url = f"sqlite:///{tmp_path / 'metaid.db'}"
    study = optuna.create_study(study_name="mine", storage=url, sampler=RandomSampler(seed=1))
    study.optimize(metaid.objective(STUDY), 2)
    other = optuna.create_study(sampler=RandomSampler(seed=1))
    other.optimize(metaid.objective(load_study(STUDY, {"seed": 9})), 2)
    spoiled = optuna.create_study(sampler=RandomSampler(seed=5))
    spoiled.optimize(metaid.objective(STUDY), 1)
    (bad,) = spoiled.trials
    bad.user_attrs["windows"] = {**bad.user_attrs["windows"], "motion": "AAAA"}
    study.add_trials([*study.trials, *other.trials, bad])
    shown = metaid.summary("mine", str(tmp_path / "metaid.db"))
    assert len(shown["foreign_trials"]) == 7
    assert shown["estimate"]["trials"] == 2
    assert shown["max_error"] < 1e-9


def test_only_the_first_trials_carry_motion() -> None:
    """As many as an estimate is made of, counted anew where another program goes on with the study."""
    study = optuna.create_study(sampler=RandomSampler(seed=1))
    study.optimize(metaid.objective(STUDY), 20)
    study.optimize(metaid.objective(STUDY), 20)
    carry = ["windows" in trial.user_attrs for trial in study.trials]
    assert carry == [True] * 12 + [False] * 28


def test_threads_and_other_processes_evaluate_what_their_trial_suggests() -> None:
    """Each thread has a plant of its own, and the objective can be pickled."""
    objective = pickle.loads(pickle.dumps(metaid.objective(STUDY)))
    study = optuna.create_study(sampler=RandomSampler(seed=1), pruner=NopPruner())
    study.optimize(objective, 12, n_jobs=2)
    for trial in study.trials:
        assert trial.value == metaid.evaluate(STUDY, trial.params).value
    assert objective(FixedTrial(objective.start)) == metaid.evaluate(STUDY, objective.start).value
    assert study.ask(objective.space).params.keys() == objective.start.keys()


def test_optuna_study_of_other_settings_is_refused_in_one_line(tmp_path: Path) -> None:
    """Nothing is written to it; nor is one accepted that maximises, or that has no trial of the objective."""
    study = optuna.create_study()
    with pytest.raises(StudyError, match="has no trial of metaid's"):
        _ = metaid.study(study).estimate
    study.optimize(metaid.objective(STUDY), 1)
    with pytest.raises(StudyError, match="is of other settings than 'three-link'"):
        metaid.objective("three-link")(study.ask())
    upwards = optuna.create_study(direction="maximize")
    with pytest.raises(StudyError, match="allowed: direction='minimize'"):
        metaid.objective(STUDY)(upwards.ask())
    assert not upwards.user_attrs
    study.set_user_attr("metaid:study", {"name": 1})
    with pytest.raises(StorageError, match="another version"):
        metaid.objective(STUDY)(study.ask())
