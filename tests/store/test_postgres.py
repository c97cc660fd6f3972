"""A study DB may be a PostgreSQL database: the same trials, whatever happens to server and driver."""

from __future__ import annotations

import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import optuna
import pandas as pd
import pytest
import sqlalchemy as sa
from conftest import Finished
from forked import Command
from pandas.testing import assert_frame_equal
from postgres import PASSWORD, QUOTED, Postgres

from metaid import api, results
from metaid.episode import Outcome
from metaid.errors import StorageError
from metaid.store import Store, Trial
from metaid.study import Progress, create_study, load_study, run_study

pytestmark = pytest.mark.slow

CHANGES = {"trials": 90, "search.coordinates": "plain", "search.start": 0.8, "episode.fall_limit": 1.0}
LONG = {**CHANGES, "trials": 1_000_000}
Metaid = Callable[..., Finished]


@pytest.fixture
def store(url: str) -> Iterator[Store]:
    """A study DB with a study, `study`, of survivors and falls, that has not been run."""
    with closing(Store(url, create=True)) as made:
        create_study(made, load_study("three-link-coast", CHANGES), "study")
        yield made


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The same study in an SQLite file, run and left alone."""
    path = str(tmp_path_factory.mktemp("alone") / "metaid.db")
    with closing(Store(path, create=True)) as made:
        create_study(made, load_study("three-link-coast", CHANGES), "study")
        run_study(made, "study", workers=1)
    return path


def assert_same(store: Store, alone: str) -> None:
    """The table is that of the study left alone."""
    assert_frame_equal(results.trials_frame(store, "study"), api.trials("study", alone), check_exact=True)


def optunas(url: str) -> list[optuna.trial.FrozenTrial]:
    """The study's trials as plain Optuna reads them."""
    study = optuna.load_study(study_name="study", storage=url)
    trials = study.trials
    study._storage.remove_session()
    study._storage._backend.engine.dispose()  # type: ignore[attr-defined]
    return trials


def count(server: Postgres, url: str) -> int:
    """How many trials there are."""
    return int(server.ask(url.rpartition("/")[2], "SELECT COUNT(*) FROM trials")[0][0])


@pytest.mark.parametrize("workers", [1, 2])
def test_trials_are_those_of_an_sqlite_file(store: Store, url: str, alone: str, workers: int) -> None:
    """Factors, values, states, steps and attributes bit for bit, through metaid and through Optuna alone."""
    run_study(store, "study", workers=workers)
    assert_same(store, alone)
    here, there = optunas(url), optunas(f"sqlite:///{alone}")
    assert {trial.state.name for trial in here} == {"COMPLETE", "PRUNED"}
    for a, b in zip(here, there, strict=True):
        for what in ("number", "state", "values", "params", "distributions", "user_attrs"):
            assert getattr(a, what) == getattr(b, what)
        assert repr(a.intermediate_values) == repr(b.intermediate_values)  # NaN of a fall is not equal to itself
        assert a.duration is not None


def test_every_command_works_and_none_shows_the_password(metaid: Metaid, server: Postgres, url: str) -> None:
    """What they print, and what they write."""
    said = ""
    for command in (
        ["create", "one-link-count", "--name", "study", "--set=trials=90"],
        ["create", "one-link-count", "--name", "study", "--exist-ok", "--set=trials=9"],
        ["run", "study"],
        ["list"],
        ["show", "study"],
        ["show", "study", "--json"],
        ["export", "study", "-o", "trials.csv"],
        ["export", "study", "-o", "trials.parquet"],
        ["plot", "study", "-o", "figures", "--format", "svg"],
        ["report", "study", "-o", "report.html"],
        ["run", "stduy"],
    ):
        done = metaid("study", *command, "--storage", url)
        refused = "--exist-ok" in command or "stduy" in command
        assert done.status == (2 if refused else 0), done.err
        said += done.out + done.err
    assert len(pd.read_csv("trials.csv")) == len(pd.read_parquet("trials.parquet")) == 90
    assert len(api.trials("study", url)) == 90
    assert len(api.lumps("study", url)) == 2
    said += Path("report.html").read_text()
    said += "".join(path.read_text(encoding="utf-8") for path in Path("figures").iterdir())
    done = metaid("study", "delete", "study", "--yes", "--storage", url)
    assert done.status == 0
    assert api.studies(url).empty
    assert count(server, url) == 0
    assert "one-link" in said
    assert "@127.0.0.1" in said
    assert PASSWORD not in unquote(said + done.out + done.err)


def test_optuna_dashboard_is_given_notes_and_graphs(store: Store) -> None:
    """As on SQLite."""
    from optuna_dashboard import get_note

    from metaid.show.dashboard import explain

    run_study(store, "study")
    explain(store, "study")
    study = optuna.load_study(study_name="study", storage=store.optuna)
    assert "# study" in get_note(study)


def test_killed_driver_is_gone_on_with(server: Postgres, store: Store, url: str, alone: str, tmp_path: Path) -> None:
    """SIGKILL between two statements of a write, twice at different ones, then to the end: the same trials."""
    run = ["study", "run", "study", "--quiet", "--storage", url]
    for statements in (3, 8):
        doomed = Command(tmp_path, *run, first=f"from soak.doomed import Doom; Doom(2, {statements})")
        assert doomed.wait() == -signal.SIGKILL
        assert count(server, url) % 9 == 0
    assert 0 < count(server, url) < 90
    run_study(store, "study")
    assert_same(store, alone)


def test_server_that_is_restarted_is_waited_for(server: Postgres, store: Store, alone: str) -> None:
    """Away for some seconds in mid-run: the run says what it waits for, goes on by itself, and the trials are the
    same.
    """
    waited: list[str] = []

    def restart(progress: Progress) -> None:
        if progress.generation == 3 and not waited:
            server.stop()
            waited.append("")
        if progress.waiting is not None:
            waited.append(progress.waiting)
            if len(waited) == 4:
                server.start()

    run_study(store, "study", watch=restart)
    assert len(waited) >= 4
    assert all("waiting for the study DB" in why for why in waited[1:])
    assert PASSWORD not in unquote("".join(waited))
    assert_same(store, alone)


def test_server_that_is_restarted_in_the_middle_of_a_write_gets_it_again(
    server: Postgres, store: Store, alone: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Between two statements of it, and nothing is logged by those that lost their connection."""
    lost: list[str] = []

    def lose(_connection: Any, _cursor: Any, statement: str, *_others: Any) -> None:
        if statement.startswith("INSERT INTO trial_params") and not lost:
            lost.append(statement)
            server.stop()
            server.start()

    sa.event.listen(store._engine, "before_cursor_execute", lose)
    run_study(store, "study")
    assert lost
    assert [record.getMessage() for record in caplog.records] == []
    assert_same(store, alone)


def test_commit_whose_answer_was_lost_is_not_done_twice(
    server: Postgres, store: Store, alone: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The server goes away after it committed a generation and before it said so."""
    dialect = store._engine.dialect
    commit, lost = dialect.do_commit, []

    def lose(connection: Any) -> None:
        wrote = connection.driver_connection.execute("SELECT COUNT(*) FROM trials").fetchone()[0]
        commit(connection)
        if wrote == 45 and not lost:
            lost.append(wrote)
            server.stop()
            server.start()
            connection.driver_connection.execute("SELECT 1")

    monkeypatch.setattr(dialect, "do_commit", lose)
    run_study(store, "study")
    assert lost
    assert_same(store, alone)


def test_server_that_does_not_come_back_is_given_up_in_one_line_that_says_how_to_go_on(
    server: Postgres, metaid: Metaid, url: str, tmp_path: Path
) -> None:
    """After the patience that was given: status 2; once it is back, the run goes on."""
    with closing(Store(url, create=True)) as store:
        create_study(store, load_study("three-link-coast", LONG), "study")
    process = Command(tmp_path, "study", "run", "study", "--quiet", "--patience", "1", "--storage", url)
    try:
        while count(server, url) == 0:
            assert process.poll() is None, process.err
            time.sleep(0.05)
        server.stop()
        status, said = process.wait(), process.err
    finally:
        process.kill()
        server.start()
    assert status == 2
    assert len(said.splitlines()) == 1
    assert "no answer for 1 s" in said
    assert said.strip().endswith("go on with: metaid study run study")
    assert PASSWORD not in unquote(said)
    before = count(server, url)
    written = re.search(r"(\d+) trials are in it", said)
    assert written
    assert int(written[1]) == before
    assert metaid("study", "run", "study", "--trials", str(before + 9), "--storage", url).status == 0
    assert count(server, url) == before + 9


def test_interrupt_is_heard_while_a_server_is_waited_for(server: Postgres, store: Store, url: str) -> None:
    """It leaves the DB at the trials that were shown, and gives the study up as soon as it can."""
    shown: list[int] = []

    def interrupt(progress: Progress) -> None:
        if progress.generation == 3 and progress.waiting is None:
            server.stop()
        if progress.waiting is not None:
            shown.append(progress.trials)
            raise KeyboardInterrupt

    try:
        with pytest.raises(KeyboardInterrupt):
            run_study(store, "study", watch=interrupt)
    finally:
        server.start()
    assert shown == [count(server, url)]
    run_study(store, "study")
    assert count(server, url) == 90


def a_trial(number: int) -> Trial:
    """A trial of three links."""
    return Trial(number, number, np.ones(6), Outcome(1.0, False, 100, (1, 1, 1)))


def test_two_who_append_at_once_never_write_the_same_number(server: Postgres, store: Store, url: str) -> None:
    """The second one waits until the first has committed, and is refused; were it not to wait, both would write."""
    names, bound = [f"gravity_{i}" for i in range(6)], np.ones(6)
    refused: list[StorageError] = []

    def second() -> None:
        with closing(Store(url)) as other:
            try:
                other.append("study", names, bound, bound, [a_trial(0)], write_check=lambda connection, study_id: None)
            except StorageError as problem:
                refused.append(problem)

    thread = threading.Thread(target=second)

    def between(_connection: object, _study_id: int) -> None:
        """The first has read the last number and written nothing."""
        thread.start()
        locked = "SELECT COUNT(*) FROM pg_stat_activity WHERE wait_event_type = 'Lock'"
        while thread.is_alive() and server.ask("postgres", locked) == [(0,)]:
            time.sleep(0.01)

    store.append("study", names, bound, bound, [a_trial(0)], write_check=between)
    thread.join()
    assert count(server, url) == 1
    assert len(refused) == 1
    assert "another program has written to it" in str(refused[0])


def test_database_is_only_changed_when_a_study_is_made(server: Postgres, metaid: Metaid, url: str) -> None:
    """Who looks for a study where there is none reads so, and leaves no table behind."""
    for command in (["list"], ["run", "study"], ["show", "study"]):
        done = metaid("study", *command, "--storage", url)
        assert done.status == 2
        assert "no study DB at postgresql://metaid:***@127.0.0.1" in done.err
        assert "make a study with 'metaid study create'" in done.err
    tables_made = "SELECT COUNT(*) FROM information_schema.tables WHERE table_schema = 'public'"
    assert server.ask(url.rpartition("/")[2], tables_made) == [(0,)]


def test_two_who_make_the_tables_at_once_both_can(server: Postgres) -> None:
    """One makes them while the other waits."""
    for _ in range(3):
        url, ready, failed = server.new_database(), threading.Barrier(3), []

        def make(url: str = url, ready: threading.Barrier = ready, failed: list[Exception] = failed) -> None:
            ready.wait()
            try:
                Store(url, create=True).close()
            except Exception as problem:
                failed.append(problem)

        threads = [threading.Thread(target=make) for _ in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert failed == []


def test_driver_that_says_no_more_in_a_transaction_is_ended_by_the_server(store: Store) -> None:
    """A machine that was switched off must not hold the study's row, and who waits for it need not for ever."""
    with store.writing("study") as (connection, _):
        for setting in ("idle_in_transaction_session_timeout", "lock_timeout"):
            assert connection.exec_driver_sql(f"SHOW {setting}").scalar() == "1min"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((QUOTED, "wrong-secret"), "password authentication failed"),
        (("127.0.0.1", "127.0.0.1:1,127.0.0.1"), "not a storage"),
        (("/studies_", "/missing_"), "does not exist"),
        ((QUOTED, "se@cret"), "an @ in a password is written as %40"),
        ((QUOTED, "se:c@r@et"), "an @ in a password is written as %40"),
        (("postgresql:", "postgres:"), "not a storage"),
        (("postgresql:", "postgresql+nonsense:"), "not a storage"),
        (("/studies_", "/studies_?nonsense="), "nonsense"),
    ],
)
def test_server_that_cannot_be_used_is_told_in_one_line_without_the_password(
    metaid: Metaid, url: str, change: tuple[str, str], message: str
) -> None:
    """Status 2, no traceback."""
    done = metaid("study", "list", "--storage", url.replace(*change))
    assert done.status == 2
    assert message in done.err
    assert len(done.err.splitlines()) == 1
    for secret in (PASSWORD, QUOTED, "wrong-secret", "se@", "cret", "c@r"):
        assert secret not in unquote(done.err)


def test_missing_driver_is_one_line_that_names_the_extra(metaid: Metaid, monkeypatch: pytest.MonkeyPatch) -> None:
    """No server is needed for this."""
    monkeypatch.setitem(sys.modules, "psycopg", None)
    done = metaid("study", "list", "--storage", "postgresql://me:secret@127.0.0.1/studies")
    assert done.status == 2
    assert "python -m pip install 'psycopg" in done.err
    assert "secret" not in done.err
    assert len(done.err.splitlines()) == 1


def test_server_that_is_not_there_is_told_at_once(metaid: Metaid) -> None:
    """Nothing is waited for before a run has begun."""
    done = metaid("study", "run", "study", "--storage", "postgresql://me:secret@127.0.0.1:1/studies")
    assert done.status == 2
    assert "postgresql://me:***@127.0.0.1:1/studies" in done.err
    assert len(done.err.splitlines()) == 1
