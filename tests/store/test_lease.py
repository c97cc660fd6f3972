"""One driver at a time runs a study, and a dead one does not hold it."""

from __future__ import annotations

import json
import os
import random
import signal
import sqlite3
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import optuna
import pytest
from conftest import Finished
from forked import Command
from postgres import Postgres

from metaid import results
from metaid.errors import StorageError
from metaid.store import Store, lease
from metaid.study import create_study, load_study, run_study

pytestmark = pytest.mark.slow

# Episodes so long that readers see many generations of few trials, and no estimate for them to make.
LONG = {
    "trials": 1_000_000,
    "sampler": "random",
    "search.generation": 10,
    "episode.steps": 4_000,
    "estimate.enabled": False,
}
Metaid = Callable[..., Finished]


class Database:
    """A study DB in an SQLite file, with a study, `study`, that goes on for hours; asked as any other tool would."""

    patience = 60.0  # s, how long a statement waits for a locked DB

    def __init__(self, storage: str) -> None:
        self.storage = storage
        with closing(Store(storage, create=True)) as store:
            create_study(store, load_study("three-link-coast", LONG), "study")

    def ask(self, statement: str) -> Any:
        """The first cell that a statement gives, if any."""
        with closing(sqlite3.connect(self.storage, timeout=self.patience)) as connection, connection:
            row = connection.execute(statement).fetchone()
        return row and row[0]

    def lose_connections(self) -> None:
        """What becomes of a machine's connections to the DB while it sleeps: nothing, of an open file."""

    def count(self) -> int:
        """How many trials there are."""
        return int(self.ask("SELECT COUNT(*) FROM trials"))

    def lease(self) -> dict[str, Any] | None:
        """The lease in the DB, if any."""
        found = self.ask("SELECT value_json FROM study_system_attributes WHERE key = 'metaid:lease'")
        return found and json.loads(found)

    def put(self, text: str) -> None:
        """Puts a text into the DB in the place of the lease."""
        self.ask("DELETE FROM study_system_attributes WHERE key = 'metaid:lease'")
        columns = "(study_id, key, value_json)"
        self.ask(f"INSERT INTO study_system_attributes {columns} VALUES (1, 'metaid:lease', '{text}')")

    def put_lease(self, lease: Mapping[str, Any]) -> None:
        """Puts a lease into the DB, in the place of any."""
        self.put(json.dumps(lease, separators=(",", ":")))

    def hold_elsewhere(self, silent: float) -> None:
        """Makes the DB say that a driver on another machine has the study, last heard of `silent` s ago."""
        heard = (datetime.now(UTC) - timedelta(seconds=silent)).isoformat()
        numbers = {"pid": 12, "started": 34, "since": "2026-01-02T03:04:05+00:00", "heartbeat": heard}
        self.put_lease({"token": "other", "host": "far-away", "machine": "another kernel", **numbers})


class ServerDatabase(Database):
    """The same on a PostgreSQL server."""

    def __init__(self, server: Postgres, url: str) -> None:
        super().__init__(url)
        self._server = server

    def ask(self, statement: str) -> Any:
        rows = self._server.ask(self.storage.rpartition("/")[2], statement)
        return rows[0][0] if rows else None

    def lose_connections(self) -> None:
        others = "datname = current_database() AND pid <> pg_backend_pid()"
        self.ask(f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE {others}")


@pytest.fixture
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Database:
    """An SQLite file, or a database on a server for tests that ask for both."""
    if getattr(request, "param", "sqlite") == "sqlite":
        return Database(str(tmp_path / "metaid.db"))
    return ServerDatabase(request.getfixturevalue("server"), request.getfixturevalue("url"))


on_both = pytest.mark.parametrize("database", ["sqlite", "postgresql"], indirect=True)


@pytest.fixture
def store(database: Database) -> Iterator[Store]:
    """The study DB, opened by this process."""
    with closing(Store(database.storage)) as store:
        yield store


@contextmanager
def running(database: Database, folder: Path) -> Iterator[Command]:
    """Another process that runs the study, once it has written something; killed at the end if it still does."""
    before = database.count()
    process = Command(folder, "study", "run", "study", "--quiet", "--storage", database.storage)
    try:
        while database.count() == before:
            assert process.poll() is None, process.err
            time.sleep(0.05)
        yield process
    finally:
        process.kill()


def lease_of_a_run(store: Store, database: Database) -> dict[str, Any]:
    """The lease of a run of 10 trials in this process, which has given it up."""
    seen: list[dict[str, Any] | None] = []
    run_study(store, "study", trials=10, watch=lambda progress: seen.append(database.lease()))
    assert database.lease() is None
    assert seen[0] is not None
    return seen[0]


def started(pid: int) -> int:
    """When a process did, in the kernel's ticks."""
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19])


@on_both
def test_second_driver_is_refused_and_told_who_runs_the_study_since_when(
    store: Store, metaid: Metaid, database: Database, tmp_path: Path
) -> None:
    """One line, status 2, for run and for delete; the first one goes on undisturbed, and where it has ended, in its own
    time or on a busy machine by force, the study is free.
    """
    with running(database, tmp_path) as process:
        lease = database.lease()
        assert lease is not None
        for command in (["run", "study"], ["delete", "study", "--yes"]):
            second = metaid("study", *command, "--storage", database.storage)
            assert second.status == 2
            said = second.err.strip()
            assert said.startswith(f"metaid: study 'study' is being run by process {process.pid} on this machine since")
            assert "\n" not in said
            assert said.endswith(f"{datetime.fromisoformat(lease['since']):%Y-%m-%d %H:%M:%S} UTC")
        before = database.count()
        while database.count() == before:
            assert process.poll() is None
            time.sleep(0.02)
        process.send(signal.SIGTERM)
        assert process.wait() == 143
    assert metaid("study", "delete", "study", "--yes", "--storage", database.storage).status == 0


@on_both
def test_killed_driver_holds_nothing(store: Store, database: Database, tmp_path: Path) -> None:
    """Its lease stays in the DB, but its process is gone: the next one need not wait."""
    with running(database, tmp_path) as process:
        process.kill()
        assert database.lease() is not None
    run_study(store, "study", trials=database.count() + 10)
    assert database.lease() is None


def test_process_that_has_the_number_of_a_dead_driver_does_not_hold_its_lease(store: Store, database: Database) -> None:
    """Numbers are used again: the process has to have started when the driver did."""
    own = lease_of_a_run(store, database)
    database.put_lease({**own, "pid": os.getppid(), "started": started(os.getppid())})
    with pytest.raises(StorageError, match=f"by process {os.getppid()} on this machine"):
        run_study(store, "study", trials=20)
    database.put_lease({**own, "pid": os.getppid(), "started": started(os.getppid()) - 1})
    run_study(store, "study", trials=20)
    assert database.count() == 20


@on_both
def test_driver_on_another_machine_holds_a_study_until_it_has_been_silent_for_a_minute(
    store: Store, database: Database
) -> None:
    """Its process cannot be looked for from here, so its heartbeat has to do."""
    database.hold_elsewhere(silent=45)
    with pytest.raises(StorageError, match=r"by process 12 on far-away, last heard of 4\d s ago \(free after 60 s of"):
        run_study(store, "study", trials=10)
    assert database.count() == 0
    database.hold_elsewhere(silent=61)
    run_study(store, "study", trials=10)
    assert database.count() == 10


def pause(process: Command) -> None:
    """Returns when the process is stopped."""
    process.send(signal.SIGSTOP)
    while Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[0] != "T":
        time.sleep(0.01)


def taken(database: Database) -> bool:
    """Takes the study for a driver elsewhere; false where the file is locked."""
    try:
        database.hold_elsewhere(silent=0)
    except sqlite3.OperationalError:
        return False
    return True


@on_both
def test_driver_that_slept_while_another_took_its_study_stops_before_it_writes(
    store: Store, database: Database, tmp_path: Path
) -> None:
    """Paused, its lease taken, woken: one line, status 2, and not a trial more; the taker's lease is left alone."""
    with running(database, tmp_path) as process:
        pause(process)
        database.lose_connections()
        database.patience = 0.1
        while not taken(database):  # it was paused within a transaction, which holds the file
            process.send(signal.SIGCONT)
            time.sleep(random.uniform(0.01, 0.1))
            pause(process)
        database.patience = 60.0
        before = database.count()
        process.send(signal.SIGCONT)
        assert process.wait(60.0) == 2
    said = process.err
    assert "the study was taken over: it is being run by process 12 on far-away" in said
    assert len(said.splitlines()) == 1
    assert database.count() == before
    left = database.lease()
    assert left is not None
    assert left["token"] == "other"


def test_second_driver_in_the_same_process_is_refused(store: Store, database: Database) -> None:
    """Two notebooks' cells, or two threads, are two drivers; an error gives the study up."""

    def again(progress: object) -> None:
        run_study(store, "study", trials=20)

    with pytest.raises(StorageError, match=f"is being run by process {os.getpid()} on this machine since"):
        run_study(store, "study", trials=40, watch=again)
    assert database.lease() is None
    run_study(store, "study", trials=20)


def test_process_that_could_not_give_its_study_up_can_take_it_again(store: Store, database: Database) -> None:
    """A lease that a full disk kept in the DB does not shut out the very process that it is of."""
    database.put_lease(lease_of_a_run(store, database))
    run_study(store, "study", trials=20)
    assert database.count() == 20


def test_driver_shows_that_it_is_alive_however_long_a_generation_takes(
    store: Store, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The heartbeat moves on while nothing is written."""
    monkeypatch.setattr(lease, "INTERVAL", 0.05)
    seen: list[str] = []

    def wait(_progress: object) -> None:
        for _ in range(2):
            found = database.lease()
            assert found is not None
            seen.append(found["heartbeat"])
            while found["heartbeat"] == seen[-1]:
                time.sleep(0.01)
                found = database.lease()
                assert found is not None

    run_study(store, "study", trials=10, watch=wait)
    assert len(set(seen)) == len(seen) == 4


def test_lease_that_metaid_did_not_write_holds_nothing(store: Store, database: Database) -> None:
    """Whatever else stands under its key is replaced."""
    for made_up in ("", "7", '{"pid": "1/../2"}', "[[[["):
        database.put(made_up)
        run_study(store, "study", trials=database.count() + 10)
        assert database.lease() is None


def test_readers_see_whole_generations_while_a_study_runs(
    store: Store, metaid: Metaid, database: Database, tmp_path: Path
) -> None:
    """metaid, Optuna and pandas, over and over while another process writes."""
    url = f"sqlite:///{database.storage}"
    sizes: list[int] = []
    with running(database, tmp_path) as process:
        while len(sizes) < 12 or len(set(sizes)) < 6:
            sizes.append(len(results.trials_frame(store, "study")))
            trials = optuna.load_study(study_name="study", storage=url).get_trials(deepcopy=False)
            assert {trial.state.name for trial in trials} <= {"COMPLETE", "PRUNED"}
            assert {len(trial.params) for trial in trials} == {6}
            sizes.append(len(trials))
        sizes.append(len(optuna.load_study(study_name="study", storage=url).trials_dataframe()))
        for command in (["list"], ["show", "study", "--json"], ["export", "study", "-o", "trials.csv"]):
            assert metaid("study", *command, "--storage", database.storage).status == 0
        sizes.append(len(Path("trials.csv").read_text().splitlines()) - 1)
        assert process.poll() is None
    assert {size % LONG["search.generation"] for size in sizes} == {0}
    assert sizes == sorted(sizes)
