"""The study DB is an ordinary Optuna study DB."""

from __future__ import annotations

import json
import math
import sqlite3
from io import BytesIO
from pathlib import Path

import numpy as np
import optuna
import pytest
from optuna.trial import TrialState

from metaid import results
from metaid.episode import Outcome
from metaid.errors import StorageError
from metaid.store import Store, Trial
from metaid.study import create_study, delete_study, load_study, run_study

CHANGES = {
    "trials": 60,
    "search.coordinates": "plain",
    "search.start": 0.7,
    "search.sigma": 0.3,
    "episode.fall_limit": 1.0,
}


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study DB with a study of survivors and falls."""
    path = tmp_path_factory.mktemp("store") / "metaid.db"
    store = Store(str(path), create=True)
    create_study(store, load_study("three-link-coast", CHANGES), "study")
    run_study(store, "study")
    return path


def test_optuna_reads_factors_values_states_and_steps_of_falls(database: Path) -> None:
    """Survivors are COMPLETE with the measure as value; falls PRUNED at the step that they survived to. These have no
    value: Optuna's tools would draw it among frequencies.
    """
    frame = results.trials_frame(Store(str(database)), "study")
    study = optuna.load_study(study_name="study", storage=f"sqlite:///{database}")
    assert study.direction.name == "MINIMIZE"
    assert {trial.state for trial in study.trials} == {TrialState.COMPLETE, TrialState.PRUNED}
    for trial, row in zip(study.trials, frame.to_dict("records"), strict=True):
        assert trial.number == row["number"]
        assert trial.state.name == row["state"]
        fell = trial.state == TrialState.PRUNED
        assert trial.value == (None if fell else row["value"])
        assert trial.user_attrs.get("fall_value") == (row["value"] if fell else None)
        assert trial.intermediate_values == pytest.approx(
            {row["steps"]: math.nan if fell else row["value"]}, nan_ok=True
        )
        assert trial.params == {
            name: row[name]
            for name in ("gravity_1", "gravity_2", "gravity_3", "coriolis_1_2", "coriolis_1_3", "coriolis_2_3")
        }
        assert trial.user_attrs["steps"] == row["steps"]
        assert trial.user_attrs["generation"] == row["generation"]
        assert [trial.user_attrs[f"periods_{i}"] for i in (1, 2, 3)] == [row[f"periods_{i}"] for i in (1, 2, 3)]
        assert trial.duration is not None
        assert (trial.state == TrialState.PRUNED) == (row["steps"] < frame["steps"].max())
    survivors = frame[frame["state"] == "COMPLETE"]
    assert study.best_trial.number == survivors["number"][survivors["value"].idxmin()]
    assert survivors["value"].max() < frame.loc[frame["state"] == "PRUNED", "value"].min()


def test_optunas_own_frame_has_every_trial(database: Path) -> None:
    """`trials_dataframe()` works on the DB unaided."""
    frame = optuna.load_study(study_name="study", storage=f"sqlite:///{database}").trials_dataframe()
    assert len(frame) == 60
    assert {"params_gravity_1", "user_attrs_steps", "user_attrs_generation"} <= set(frame.columns)


@pytest.mark.slow
def test_optuna_can_go_on_with_a_copy_of_the_study(database: Path, tmp_path: Path) -> None:
    """Another sampler of Optuna can learn from the trials: distributions are whole."""
    copy = f"sqlite:///{tmp_path / 'copy.db'}"
    optuna.copy_study(from_study_name="study", from_storage=f"sqlite:///{database}", to_storage=copy)
    study = optuna.load_study(study_name="study", storage=copy, sampler=optuna.samplers.TPESampler(seed=1))
    trial = study.ask()
    assert 0.5 <= trial.suggest_float("gravity_1", 0.5, 2.0) <= 2.0


def test_dashboard_answers_for_the_study(database: Path) -> None:
    """optuna-dashboard's own application lists the study, and its trials with states and parameters."""
    from optuna_dashboard import wsgi

    application = wsgi(f"sqlite:///{database}")

    def get(path: str) -> dict:  # type: ignore[type-arg]
        status = []
        environment = {
            "REQUEST_METHOD": "GET",
            "PATH_INFO": path,
            "QUERY_STRING": "after=0",
            "SERVER_NAME": "localhost",
            "SERVER_PORT": "80",
            "wsgi.input": BytesIO(),
            "wsgi.url_scheme": "http",
            "HTTP_CONTENT_TYPE": "application/json",
            "CONTENT_TYPE": "application/json",
        }
        body = b"".join(application(environment, lambda code, _headers, _error=None: status.append(code)))
        assert status[0].startswith("200"), body
        return json.loads(body)

    studies = get("/api/studies")["study_summaries"]
    assert [study["study_name"] for study in studies] == ["study"]
    detail = get(f"/api/studies/{studies[0]['study_id']}")
    assert len(detail["trials"]) == 60
    assert {trial["state"] for trial in detail["trials"]} == {"Complete", "Pruned"}
    assert len(detail["trials"][0]["params"]) == 6


def test_only_whole_generations_are_ever_in_the_db(tmp_path: Path) -> None:
    """A reader that looks after every generation sees all before it, itself once the run ends, and nothing RUNNING."""
    path = tmp_path / "metaid.db"
    store = Store(str(path), create=True)
    create_study(store, load_study("three-link-coast", CHANGES), "study")
    seen = []

    def look(_progress: object) -> None:
        with sqlite3.connect(path) as connection:
            seen.append(connection.execute("SELECT state, COUNT(*) FROM trials GROUP BY state").fetchall())

    run_study(store, "study", trials=45, watch=look)
    assert [sum(count for _, count in rows) for rows in seen] == [0, 0, 9, 18, 27, 36]
    look(None)
    assert sum(count for _, count in seen[-1]) == 45
    assert {state for rows in seen for state, _ in rows} <= {"COMPLETE", "PRUNED"}
    with sqlite3.connect(path) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]


def test_deleted_study_leaves_no_row_behind_and_others_alone(tmp_path: Path) -> None:
    """All of its rows go, none of another study's."""
    path = tmp_path / "metaid.db"
    store = Store(str(path), create=True)
    for name in ("one", "two"):
        create_study(store, load_study("three-link-coast", CHANGES), name)
        run_study(store, name, trials=18)
    with sqlite3.connect(path) as connection:
        tables_with_rows = [row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        counts = {
            table: connection.execute(f"SELECT COUNT(*) FROM {table}").fetchone()[0] for table in tables_with_rows
        }
        delete_study(store, "one")
        rest = {table: connection.execute(f"SELECT COUNT(*) FROM {table}").fetchone()[0] for table in tables_with_rows}
    assert store.names() == ["two"]
    assert rest["trials"] == 18
    assert all(rest[table] == counts[table] / 2 for table in counts if table not in ("alembic_version", "version_info"))


def test_study_that_optuna_made_is_left_alone(tmp_path: Path) -> None:
    """Other studies may live in the same DB; metaid neither lists nor runs them."""
    url = f"sqlite:///{tmp_path / 'shared.db'}"
    optuna.create_study(study_name="somebody's", storage=url)
    store = Store(url)
    assert store.names() == []
    with pytest.raises(StorageError, match="unknown study"):
        delete_study(store, "somebody's")
    with pytest.raises(StorageError, match="has a study"):
        create_study(store, load_study("three-link-coast"), "somebody's")
    create_study(store, load_study("three-link-coast"), "ours")
    assert store.names() == ["ours"]


def test_settings_in_the_db_are_json_and_nothing_is_pickled(database: Path) -> None:
    """No column of the DB holds a blob."""
    with sqlite3.connect(database) as connection:
        names = [row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        for name in names:
            for row in connection.execute(f"SELECT * FROM {name}"):
                assert not any(isinstance(value, bytes) for value in row)
        spec = connection.execute("SELECT value_json FROM study_user_attributes WHERE key = 'metaid:study'").fetchone()[
            0
        ]
    assert json.loads(spec)["study"]["sampler"] == "cmaes"


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """A DB with a study, `arm`, of a plant with two joints, whose one parameter no kind of lump has the name of."""
    path = tmp_path / "metaid.db"
    store = Store(str(path), create=True)
    store.create("arm", "{}", 2)
    store.append("arm", ["load"], np.zeros(1), np.ones(1), [Trial(0, 0, np.ones(1), Outcome(1.0, False, 9, (3, 4)))])
    store.close()
    return path


def change(path: Path, statement: str) -> None:
    """What another program does to a DB."""
    with sqlite3.connect(path) as connection:
        connection.execute(statement)


def test_joints_are_counted_where_the_study_says_so_and_not_by_the_names_of_lumps(arm: Path) -> None:
    """A study of any parameters has its periods per joint back."""
    assert [trial.outcome.periods for trial in Store(str(arm)).trials("arm", ["load"])] == [(3, 4)]


@pytest.mark.parametrize("joints", ["0", "-1", "3", "1000000000", "null", "[2]", "nonsense"])
def test_number_of_joints_that_cannot_be_is_refused(arm: Path, joints: str) -> None:
    """None, more than the trials have periods of, or not a number."""
    change(arm, f"UPDATE study_user_attributes SET value_json = '{joints}' WHERE key = 'metaid:joints'")
    with pytest.raises(StorageError, match="trials that are not as metaid wrote them"):
        Store(str(arm)).trials("arm", ["load"])


@pytest.mark.parametrize("number", [0, 2])
def test_trials_that_do_not_follow_the_last_are_refused_and_none_is_written(arm: Path, number: int) -> None:
    """Another program has written to the study meanwhile, or has taken trials away."""
    store, trial = Store(str(arm)), Trial(number, 0, np.ones(1), Outcome(1.0, False, 9, (3, 4)))
    with pytest.raises(StorageError, match=f"has 1 trials where {number} were expected: another program has written"):
        store.append("arm", ["load"], np.zeros(1), np.ones(1), [trial])
    assert store.count("arm") == 1
