"""One driver at a time runs a study that is kept on a PostgreSQL server, by the server's clock."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from conftest import Finished
from postgres import Postgres

from metaid.errors import StorageError
from metaid.store.database import Store
from metaid.study.create import create_study
from metaid.study.problem import load_study
from metaid.study.run import run_study
from soak.common import METAID

LONG = {"trials": 1_000_000, "sampler": "tpe", "search.generation": 10}
Metaid = Callable[..., Finished]


class Database:
    """A database on a server, asked as any PostgreSQL tool would, with a study, `study`, that goes on for hours."""

    def __init__(self, server: Postgres, url: str) -> None:
        self.url = url
        self._server = server
        with closing(Store(url, create=True)) as store:
            create_study(store, load_study("three-link", LONG), "study")

    def ask(self, statement: str) -> list[tuple[object, ...]]:
        return self._server.ask(self.url.rpartition("/")[2], statement)

    def count(self) -> int:
        """How many trials there are."""
        return int(str(self.ask("SELECT COUNT(*) FROM trials")[0][0]))

    def held(self) -> str | None:
        """The lease in the DB, if any."""
        found = self.ask("SELECT value_json FROM study_system_attributes WHERE key = 'metaid:lease'")
        return str(found[0][0]) if found else None

    def hold_elsewhere(self, silent: float) -> None:
        """Makes the DB say that a driver on another machine has the study, last heard of `silent` s ago."""
        now = "to_char(timezone('UTC', clock_timestamp()) - interval '%g s', 'YYYY-MM-DD\"T\"HH24:MI:SS.US+00:00')"
        heard = self.ask(f"SELECT {now % silent}")[0][0]
        numbers = {"pid": 12, "started": 34, "since": "2026-01-02T03:04:05+00:00", "heartbeat": heard}
        lease = json.dumps({"token": "other", "host": "far-away", "machine": "another kernel", **numbers})
        self.ask("DELETE FROM study_system_attributes WHERE key = 'metaid:lease'")
        columns = "(study_id, key, value_json)"
        self.ask(f"INSERT INTO study_system_attributes {columns} VALUES (1, 'metaid:lease', '{lease}')")


@pytest.fixture
def database(server: Postgres, url: str) -> Database:
    return Database(server, url)


@pytest.fixture
def store(database: Database) -> Iterator[Store]:
    with closing(Store(database.url)) as opened:
        yield opened


@contextmanager
def running(database: Database) -> Iterator[subprocess.Popen[str]]:
    """Another process that runs the study, once it has written something; killed at the end if it still does."""
    command = [*METAID, "study", "run", "study", "--quiet", "--storage", database.url]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            while database.count() == 0:
                assert process.poll() is None
                time.sleep(0.05)
            yield process
        finally:
            process.kill()


def test_second_driver_is_refused_and_a_killed_one_holds_nothing(
    database: Database, store: Store, metaid: Metaid
) -> None:
    """One line, status 2; once the first is killed its lease is still there, and shuts nobody out on its machine."""
    with running(database) as process:
        second = metaid("study", "run", "study", "--storage", database.url)
        assert second.status == 2
        assert second.err.startswith(f"metaid: study 'study' is being run by process {process.pid} on this machine")
        assert len(second.err.splitlines()) == 1
        process.kill()
        process.wait()
    assert database.held() is not None
    run_study(store, "study", trials=database.count() + 10)
    assert database.held() is None


def test_driver_on_another_machine_holds_a_study_until_it_has_been_silent_for_a_minute(
    database: Database, store: Store
) -> None:
    """By the clock of the server, whatever those of the machines say."""
    database.hold_elsewhere(silent=45)
    with pytest.raises(StorageError, match=r"by process 12 on far-away, last heard of 4\d s ago \(free after 60 s of"):
        run_study(store, "study", trials=10)
    assert database.count() == 0
    database.hold_elsewhere(silent=61)
    run_study(store, "study", trials=10)
    assert database.count() == 10


def test_driver_that_slept_while_another_took_its_study_stops_before_it_writes(database: Database) -> None:
    """Paused, its lease taken, woken: one line, status 2, and not a trial more; the taker's lease is left alone."""
    with running(database) as process:
        process.send_signal(signal.SIGSTOP)
        while Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[0] != "T":
            time.sleep(0.01)
        # As a machine that went to sleep loses its connections, and with them what it has under way.
        others = "datname = current_database() AND pid <> pg_backend_pid()"
        database.ask(f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE {others}")
        before = database.count()
        database.hold_elsewhere(silent=0)
        process.send_signal(signal.SIGCONT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 2
    assert "the study was taken over: it is being run by process 12 on far-away" in said
    assert len(said.splitlines()) == 1
    assert database.count() == before
    assert "far-away" in (database.held() or "")
