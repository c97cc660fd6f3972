"""Trials that metaid did not write: they are named and left alone, and metaid's own are what they would be without."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import optuna
import pandas as pd
import pytest
from conftest import Finished
from optuna.distributions import FloatDistribution
from optuna.trial import create_trial

from metaid import results
from metaid.errors import StorageError
from metaid.store import Store
from metaid.study import create_study, load_study, run_study

pytestmark = pytest.mark.slow

TRIALS = 36
GENERATION = 9
CHANGES = {"trials": TRIALS, "search.coordinates": "plain", "search.start": 0.8, "episode.fall_limit": 1.0}
Metaid = Callable[..., Finished]
Foreign = Callable[[optuna.Study], object]


def asked(study: optuna.Study) -> None:
    """A trial that is running, with one of our parameters."""
    study.ask().suggest_float("gravity_1", 0.5, 2.0)


def enqueued(study: optuna.Study) -> None:
    """A trial that waits."""
    study.enqueue_trial({"gravity_1": 1.0})


def added(study: optuna.Study) -> None:
    """A trial with our attributes, in another type, and a parameter that we have not."""
    space = {"strange": FloatDistribution(0.0, 1.0)}
    study.add_trial(
        create_trial(value=1.0, params={"strange": 0.5}, distributions=space, user_attrs={"steps": "x", "windows": "y"})
    )


def copied(study: optuna.Study) -> None:
    """Copies of our own trials, with all that they have."""
    study.add_trials(study.trials[-3:])


def told(study: optuna.Study) -> None:
    """A trial that failed."""
    study.tell(study.ask(), state=optuna.trial.TrialState.FAIL)


def made(path: Path) -> Store:
    """A DB with a study without trials."""
    store = Store(str(path), create=True)
    create_study(store, load_study("three-link-coast", CHANGES), "study")
    return store


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    """The trials of a study that nobody else has touched."""
    with closing(made(tmp_path_factory.mktemp("alone") / "metaid.db")) as store:
        run_study(store, "study")
        return results.trials_frame(store, "study")


@pytest.mark.parametrize("foreign", [asked, enqueued, added, copied, told], ids=lambda each: each.__name__)
def test_trials_of_others_leave_ours_as_they_would_be(tmp_path: Path, alone: pd.DataFrame, foreign: Foreign) -> None:
    """Before the first of ours, in the middle and at the end: the same table bit for bit, and Optuna's own numbers have
    no gap.
    """
    with closing(made(tmp_path / "metaid.db")) as store:
        study = optuna.load_study(study_name="study", storage=f"sqlite:///{tmp_path / 'metaid.db'}")
        for total in (GENERATION, 2 * GENERATION, TRIALS):
            if foreign is not copied or study.trials:
                foreign(study)
            run_study(store, "study", trials=total)
        foreign(study)
        pd.testing.assert_frame_equal(results.trials_frame(store, "study"), alone, check_exact=True)
        assert store.count("study") == TRIALS
        numbers = [trial.number for trial in study.get_trials(deepcopy=False)]
        assert numbers == list(range(len(numbers)))


def test_trial_added_while_a_run_goes_on_is_left_alone(tmp_path: Path, alone: pd.DataFrame) -> None:
    """Another program adds one after every generation."""
    with closing(made(tmp_path / "metaid.db")) as store:
        study = optuna.load_study(study_name="study", storage=f"sqlite:///{tmp_path / 'metaid.db'}")
        run_study(store, "study", watch=lambda _: study.enqueue_trial({"gravity_1": 1.0}))
        pd.testing.assert_frame_equal(results.trials_frame(store, "study"), alone, check_exact=True)
        assert len(study.trials) == TRIALS + TRIALS // GENERATION + 1


def test_show_says_which_trials_are_others(metaid: Metaid) -> None:
    """By Optuna's numbers, in the text and in the JSON; there is no such entry where there are none."""
    with closing(made(Path("metaid.db"))) as store:
        run_study(store, "study", trials=GENERATION)
    assert "foreign_trials" not in json.loads(metaid("study", "show", "study", "--json").out)
    study = optuna.load_study(study_name="study", storage="sqlite:///metaid.db")
    asked(study)
    enqueued(study)
    shown = json.loads(metaid("study", "show", "study", "--json").out)
    assert shown["foreign_trials"] == [{"number": 9, "state": "RUNNING"}, {"number": 10, "state": "WAITING"}]
    assert shown["trials"]["total"] == GENERATION
    assert "left alone and not counted here: 9 RUNNING, 10 WAITING" in metaid("study", "show", "study").out
    assert metaid("study", "list").status == 0


def test_trials_of_another_study_with_other_settings_are_not_taken_for_ours(tmp_path: Path) -> None:
    """The next one of another seed's, which has the number that ours would have."""
    with closing(made(tmp_path / "metaid.db")) as store:
        create_study(store, load_study("three-link-coast", {**CHANGES, "seed": 9}), "other")
        run_study(store, "study", trials=GENERATION)
        run_study(store, "other", trials=2 * GENERATION)
        url = f"sqlite:///{tmp_path / 'metaid.db'}"
        others = optuna.load_study(study_name="other", storage=url).trials[GENERATION:]
        optuna.load_study(study_name="study", storage=url).add_trials(others)
        assert store.count("study") == GENERATION
        assert run_study(store, "study").trials == TRIALS


def test_study_from_which_one_of_our_trials_is_missing_is_refused(tmp_path: Path) -> None:
    """Its successors are ours, and it is not there: the DB was changed by hand."""
    with closing(made(tmp_path / "metaid.db")) as store:
        run_study(store, "study", trials=GENERATION)
        with closing(sqlite3.connect(tmp_path / "metaid.db")) as connection, connection:
            connection.execute("DELETE FROM trial_user_attributes WHERE trial_id = 4 AND key = 'metaid:trial'")
        with pytest.raises(StorageError, match="not as metaid wrote them"):
            run_study(store, "study")


def orphaned(path: Path) -> None:
    """Deletes every study as a program does that does not ask for foreign keys, and leaves their rows behind."""
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("DELETE FROM studies")


def test_new_study_inherits_nothing_of_a_deleted_one_with_its_id(tmp_path: Path, alone: pd.DataFrame) -> None:
    """Neither trials nor attributes nor directions; it runs as any other."""
    with closing(made(tmp_path / "metaid.db")) as store:
        run_study(store, "study", trials=2 * GENERATION)
        orphaned(tmp_path / "metaid.db")
        create_study(store, load_study("three-link-coast", CHANGES), "study")
        assert store.count("study") == 0
        run_study(store, "study")
        pd.testing.assert_frame_equal(results.trials_frame(store, "study"), alone, check_exact=True)
        study = optuna.load_study(study_name="study", storage=f"sqlite:///{tmp_path / 'metaid.db'}")
        assert len(study.trials) == TRIALS


def test_new_trial_inherits_nothing_of_a_deleted_one_with_its_id(tmp_path: Path, alone: pd.DataFrame) -> None:
    """What a program left of trials after this study was made, it does not get."""
    with closing(made(tmp_path / "metaid.db")) as store:
        with closing(sqlite3.connect(tmp_path / "metaid.db")) as connection, connection:
            columns = "(trial_id, key, value_json)"
            connection.execute(f"INSERT INTO trial_user_attributes {columns} VALUES (3, 'generation', '7')")
            connection.execute(
                "INSERT INTO trial_values (trial_id, objective, value, value_type) VALUES (4, 0, 1.0, 'FINITE')"
            )
        run_study(store, "study")
        pd.testing.assert_frame_equal(results.trials_frame(store, "study"), alone, check_exact=True)
