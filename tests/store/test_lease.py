"""One driver at a time runs a study, and a dead one does not hold it."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import optuna
import pytest
from conftest import Finished

from metaid import results
from metaid.errors import StorageError
from metaid.store import lease
from metaid.store.database import Store
from metaid.study.create import create_study
from metaid.study.problem import load_study
from metaid.study.run import run_study
from soak.common import METAID

LONG = {"trials": 1_000_000, "sampler": "tpe", "search.generation": 10}
Metaid = Callable[..., Finished]


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    """A study DB with a study, `study`, that goes on for hours."""
    with closing(Store(str(tmp_path / "metaid.db"), create=True)) as store:
        create_study(store, load_study("three-link", LONG), "study")
        yield store


@contextmanager
def running(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that runs the study, once it has written something; killed at the end if it still does."""
    before = count(folder)
    command = [*METAID, "study", "run", "study", "--quiet"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=pipe, text=True) as process:
        try:
            while count(folder) == before:
                assert process.poll() is None
                time.sleep(0.02)
            yield process
        finally:
            process.kill()


def query(folder: Path, statement: str, *values: object) -> Any:
    """The first cell that a statement gives, as any SQLite tool would ask it."""
    with closing(sqlite3.connect(folder / "metaid.db", timeout=60)) as connection, connection:
        row = connection.execute(statement, values).fetchone()
    return row and row[0]


def count(folder: Path) -> int:
    """How many trials there are."""
    return int(query(folder, "SELECT COUNT(*) FROM trials"))


def held(folder: Path) -> dict[str, Any] | None:
    """The lease in the DB, if any."""
    found = query(folder, "SELECT value_json FROM study_system_attributes WHERE key = 'metaid:lease'")
    return found and json.loads(found)


def leave(folder: Path, lease: Mapping[str, Any]) -> None:
    """Puts a lease into the DB, in the place of any."""
    query(folder, "DELETE FROM study_system_attributes WHERE key = 'metaid:lease'")
    statement = "INSERT INTO study_system_attributes (study_id, key, value_json) VALUES (1, 'metaid:lease', ?)"
    query(folder, statement, json.dumps(lease, separators=(",", ":")))


def hold_elsewhere(folder: Path, silent: float) -> None:
    """Makes the DB say that a driver on another machine has the study, last heard of `silent` s ago."""
    heard = (datetime.now(UTC) - timedelta(seconds=silent)).isoformat()
    numbers = {"pid": 12, "started": 34, "since": "2026-01-02T03:04:05+00:00", "heartbeat": heard}
    leave(folder, {"token": "other", "host": "far-away", "machine": "another kernel", **numbers})


def lease_of_a_run(store: Store, folder: Path) -> dict[str, Any]:
    """The lease of a run of 10 trials in this process, which has given it up."""
    seen: list[dict[str, Any] | None] = []
    run_study(store, "study", trials=10, watch=lambda progress: seen.append(held(folder)))
    assert held(folder) is None
    assert seen[0] is not None
    return seen[0]


def started(pid: int) -> int:
    """When a process did, in the kernel's ticks."""
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19])


def test_second_driver_is_refused_and_told_who_runs_the_study_since_when(
    store: Store, metaid: Metaid, tmp_path: Path
) -> None:
    """One line, status 2, for run and for delete; the first one goes on undisturbed and gives the study up at its
    end.
    """
    with running(tmp_path) as process:
        lease = held(tmp_path)
        assert lease is not None
        for command in (["run", "study"], ["delete", "study", "--yes"]):
            second = metaid("study", *command)
            assert second.status == 2
            said = second.err.strip()
            assert said.startswith(f"metaid: study 'study' is being run by process {process.pid} on this machine since")
            assert "\n" not in said
            assert said.endswith(f"{datetime.fromisoformat(lease['since']):%Y-%m-%d %H:%M:%S} UTC")
        before = count(tmp_path)
        while count(tmp_path) == before:
            assert process.poll() is None
            time.sleep(0.02)
        process.send_signal(signal.SIGTERM)
        assert process.wait() == 143
    assert held(tmp_path) is None
    assert metaid("study", "delete", "study", "--yes").status == 0


def test_killed_driver_holds_nothing(store: Store, tmp_path: Path) -> None:
    """Its lease stays in the DB, but its process is gone: the next one need not wait."""
    with running(tmp_path) as process:
        process.kill()
        process.wait()
        assert held(tmp_path) is not None
    run_study(store, "study", trials=count(tmp_path) + 10)
    assert held(tmp_path) is None


def test_process_that_has_the_number_of_a_dead_driver_does_not_hold_its_lease(store: Store, tmp_path: Path) -> None:
    """Numbers are used again: the process has to have started when the driver did."""
    own = lease_of_a_run(store, tmp_path)
    leave(tmp_path, {**own, "pid": os.getppid(), "started": started(os.getppid())})
    with pytest.raises(StorageError, match=f"by process {os.getppid()} on this machine"):
        run_study(store, "study", trials=20)
    leave(tmp_path, {**own, "pid": os.getppid(), "started": started(os.getppid()) - 1})
    run_study(store, "study", trials=20)
    assert count(tmp_path) == 20


def test_driver_on_another_machine_holds_a_study_until_it_has_been_silent_for_a_minute(
    store: Store, tmp_path: Path
) -> None:
    """Its process cannot be looked for from here, so its heartbeat has to do."""
    hold_elsewhere(tmp_path, silent=45)
    with pytest.raises(StorageError, match=r"by process 12 on far-away, last heard of 4\d s ago \(free after 60 s of"):
        run_study(store, "study", trials=10)
    assert count(tmp_path) == 0
    hold_elsewhere(tmp_path, silent=61)
    run_study(store, "study", trials=10)
    assert count(tmp_path) == 10


def test_driver_that_slept_while_another_took_its_study_stops_before_it_writes(store: Store, tmp_path: Path) -> None:
    """Paused, its lease taken, woken: one line, status 2, and not a trial more; the taker's lease is left alone."""
    with running(tmp_path) as process:
        process.send_signal(signal.SIGSTOP)
        while Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[0] != "T":
            time.sleep(0.01)
        before = count(tmp_path)
        hold_elsewhere(tmp_path, silent=0)
        process.send_signal(signal.SIGCONT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 2
    assert "the study was taken over: it is being run by process 12 on far-away" in said
    assert len(said.splitlines()) == 1
    assert count(tmp_path) == before
    left = held(tmp_path)
    assert left is not None
    assert left["token"] == "other"


def test_second_driver_in_the_same_process_is_refused(store: Store, tmp_path: Path) -> None:
    """Two notebooks' cells, or two threads, are two drivers; an error gives the study up."""

    def again(progress: object) -> None:
        run_study(store, "study", trials=20)

    with pytest.raises(StorageError, match=f"is being run by process {os.getpid()} on this machine since"):
        run_study(store, "study", trials=40, watch=again)
    assert held(tmp_path) is None
    run_study(store, "study", trials=20)


def test_process_that_could_not_give_its_study_up_can_take_it_again(store: Store, tmp_path: Path) -> None:
    """A lease that a full disk kept in the DB does not shut out the very process that it is of."""
    leave(tmp_path, lease_of_a_run(store, tmp_path))
    run_study(store, "study", trials=20)
    assert count(tmp_path) == 20


def test_driver_shows_that_it_is_alive_however_long_a_generation_takes(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The heartbeat moves on while nothing is written."""
    monkeypatch.setattr(lease, "INTERVAL", 0.05)
    seen: list[str] = []

    def wait(_progress: object) -> None:
        for _ in range(2):
            found = held(tmp_path)
            assert found is not None
            seen.append(found["heartbeat"])
            while found["heartbeat"] == seen[-1]:
                time.sleep(0.01)
                found = held(tmp_path)
                assert found is not None

    run_study(store, "study", trials=10, watch=wait)
    assert len(set(seen)) == len(seen) == 4


def test_lease_that_metaid_did_not_write_holds_nothing(store: Store, tmp_path: Path) -> None:
    """Whatever else stands under its key is replaced."""
    insert = "INSERT INTO study_system_attributes (study_id, key, value_json) VALUES (1, 'metaid:lease', ?)"
    for made_up in ("", "7", '{"pid": "1/../2"}', "[[[["):
        query(tmp_path, insert, made_up)
        run_study(store, "study", trials=count(tmp_path) + 10)
        assert held(tmp_path) is None


def test_readers_see_whole_generations_while_a_study_runs(store: Store, metaid: Metaid, tmp_path: Path) -> None:
    """metaid, Optuna and pandas, over and over while another process writes."""
    url = f"sqlite:///{tmp_path / 'metaid.db'}"
    sizes: list[int] = []
    with running(tmp_path) as process:
        while len(sizes) < 12 or len(set(sizes)) < 6:
            sizes.append(len(results.trials_frame(store, "study")))
            trials = optuna.load_study(study_name="study", storage=url).get_trials(deepcopy=False)
            assert {trial.state.name for trial in trials} <= {"COMPLETE", "PRUNED"}
            assert {len(trial.params) for trial in trials} == {6}
            sizes.append(len(trials))
        sizes.append(len(optuna.load_study(study_name="study", storage=url).trials_dataframe()))
        for command in (["list"], ["show", "study", "--json"], ["export", "study", "-o", "trials.csv"]):
            assert metaid("study", *command).status == 0
        sizes.append(len(Path("trials.csv").read_text().splitlines()) - 1)
        assert process.poll() is None
    assert {size % LONG["search.generation"] for size in sizes} == {0}
    assert sizes == sorted(sizes)
