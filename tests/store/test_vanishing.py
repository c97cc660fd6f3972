"""A DB's file that is deleted, moved or replaced in use, what a killed `create` leaves, and names of files."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import optuna
import pandas as pd
import pytest
from conftest import Finished
from forked import Command
from places import ROOT

from metaid import results
from metaid.errors import StorageError
from metaid.store import Store
from metaid.study import Progress, create_study, load_study, run_study

pytestmark = pytest.mark.slow

TRIALS = 45
GENERATION = 9
CHANGES = {"trials": TRIALS, "search.coordinates": "plain", "search.start": 0.8, "episode.fall_limit": 1.0}
Metaid = Callable[..., Finished]


def deleted(path: Path) -> None:
    """The file alone, as `rm` of it does."""
    path.unlink()


def moved(path: Path) -> None:
    """The file alone; its log stays behind."""
    path.rename(path.with_name("elsewhere.db"))


def replaced(path: Path) -> None:
    """Another file under its name: a copy of the DB as it is now."""
    other = path.with_name("other.db")
    with closing(sqlite3.connect(path, timeout=60)) as ours, closing(sqlite3.connect(other)) as copy:
        ours.backup(copy)
    other.replace(path)


def without_log(path: Path) -> None:
    """The file with what has been carried over into it."""
    path.with_name(f"{path.name}-wal").unlink()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, pd.DataFrame]:
    """A DB with a study without trials, not to be changed, and the trials of all of it."""
    folder = tmp_path_factory.mktemp("made")
    with closing(Store(str(folder / "empty.db"), create=True)) as store:
        create_study(store, load_study("three-link-coast", CHANGES), "study")
    shutil.copy(folder / "empty.db", folder / "whole.db")
    with closing(Store(str(folder / "whole.db"))) as store:
        run_study(store, "study")
        return folder / "empty.db", results.trials_frame(store, "study")


@pytest.fixture
def path(made: tuple[Path, pd.DataFrame], tmp_path: Path) -> Path:
    """A copy of the study without trials."""
    return Path(shutil.copy(made[0], tmp_path / "metaid.db"))


def interrupted(path: Path, what: Callable[[Path], None], at: int) -> str:
    """Runs the study and does `what` to its file once `at` trials are in it; how the run ended."""

    def look(progress: Progress) -> None:
        if progress.trials == at:
            what(path)

    with closing(Store(str(path))) as store, pytest.raises(StorageError) as refused:  # noqa: PT012
        run_study(store, "study", watch=look)
        results.lumps_frame(store, "study")
    return str(refused.value)


@pytest.mark.parametrize("at", [2 * GENERATION, TRIALS])
@pytest.mark.parametrize(
    ("what", "said"),
    [
        (deleted, "the file was deleted or moved while it was in use"),
        (moved, "the file was deleted or moved while it was in use"),
        (replaced, "the file was replaced while it was in use"),
        (without_log, "metaid.db-wal was removed while the DB was in use"),
    ],
)
def test_file_that_vanishes_in_mid_run_ends_it(path: Path, what: Callable[[Path], None], said: str, at: int) -> None:
    """At the next generation, or, after the last one, before a result is told that is in no DB; no new file is made."""
    assert said in interrupted(path, what, at)
    assert path.exists() == (what in (replaced, without_log))


@pytest.mark.parametrize("what", [moved, without_log])
def test_run_goes_on_when_what_is_left_is_put_back(
    path: Path, made: tuple[Path, pd.DataFrame], what: Callable[[Path], None]
) -> None:
    """The table is that of a run that nothing happened to."""
    interrupted(path, what, 2 * GENERATION)
    if what is moved:
        path.with_name("elsewhere.db").rename(path)
    with closing(Store(str(path))) as store:
        run_study(store, "study")
        pd.testing.assert_frame_equal(results.trials_frame(store, "study"), made[1], check_exact=True)


def test_file_that_another_is_copied_over_in_mid_run_ends_it_in_a_line(path: Path, tmp_path: Path) -> None:
    """The file is the same one to the system, and its content another DB's."""
    other = tmp_path / "other.db"
    with closing(Store(str(other), create=True)) as store:
        create_study(store, load_study("one-link-count"))
    content = other.read_bytes()

    def copy_over(file: Path) -> None:
        file.write_bytes(content)

    interrupted(path, copy_over, 2 * GENERATION)


def test_command_whose_db_vanishes_exits_with_status_2_and_one_line(path: Path, tmp_path: Path) -> None:
    """A real run in a process of its own, whose file is deleted by another."""
    code = "import os; from metaid.study import run; made = run.Writer.write\n"
    code += f"def write(self):\n    made(self)\n    os.path.exists({str(path)!r}) and os.unlink({str(path)!r})\n"
    code += "run.Writer.write = write"
    ran = Command(tmp_path, "study", "run", "study", "--quiet", "--storage", str(path), first=code)
    assert (ran.wait(), ran.out) == (2, "")
    assert ran.err.startswith("metaid: ")
    assert ran.err.count("\n") == 1


def test_log_of_a_db_that_has_gone_is_not_taken_for_a_new_ones(metaid: Metaid) -> None:
    """SQLite would read the old trials out of it into the new file."""
    Path("metaid.db-wal").write_bytes(b"what a killed run left")
    refused = metaid("study", "create", "one-link-count")
    assert refused.status == 2
    assert "metaid.db-wal is left of a DB that was here" in refused.err
    assert not Path("metaid.db").exists()


KILLED = """
import os, signal, sys
from pathlib import Path
import metaid.store.sqlite as made
os.link = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
made.make_file(Path(sys.argv[1]), b"half")
"""


def test_litter_of_a_killed_create_is_removed_by_the_next(metaid: Metaid) -> None:
    """What other programs have there, and a create that is under way, is left alone."""
    killed = subprocess.run([sys.executable, "-c", KILLED, "metaid.db"], env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert killed.returncode == -signal.SIGKILL
    assert [path.name for path in Path().iterdir()] != []
    kept = {f".metaid.db.{os.getppid()}", ".metaid.db.backup", ".other.db.999999999"}
    for name in kept | {".metaid.db.999999999-journal"}:
        Path(name).touch()
    assert metaid("study", "create", "one-link-count").status == 0
    assert {path.name for path in Path().iterdir()} == {*kept, "metaid.db"}


@pytest.mark.parametrize("name", ["a?b.db", "a%20b.db", "100%.db", "a#b.db", "{x}.db", "a b.db", "./:memory:", "ü.db"])
def test_path_means_the_file_of_that_very_name(metaid: Metaid, name: str) -> None:
    """Whatever letters are in it, and that file alone; Optuna opens it by its URL."""
    assert metaid("study", "create", "one-link-count", "--storage", name).status == 0
    assert [path.name for path in Path().iterdir()] == [Path(name).name]
    assert "one-link-count" in metaid("study", "list", "--storage", name).out
    with closing(Store(name)) as store:
        assert optuna.get_all_study_names(store.url) == ["one-link-count"]
    assert metaid("study", "list", "--storage", store.url).status == 0


@pytest.mark.parametrize(
    ("storage", "message"),
    [
        (":memory:", "a DB in memory would be gone"),
        ("sqlite://", "a DB in memory would be gone"),
        ("sqlite:///:memory:", "a DB in memory would be gone"),
        ("sqlite:///file::memory:?uri=true", "unknown option 'uri' (allowed: timeout)"),
        ("sqlite:///x.db?mode=memory", "unknown option 'mode' (allowed: timeout)"),
        ("sqlite://x.db", "not the URL of an SQLite file"),
        ("sqlite+aiosqlite:///x.db", "not the URL of an SQLite file"),
    ],
)
def test_storage_that_cannot_be_meant_is_refused(metaid: Metaid, storage: str, message: str) -> None:
    """In one line, and no file of a strange name is made."""
    for command in (("create", "one-link-count"), ("list",)):
        refused = metaid("study", *command, "--storage", storage)
        assert refused.status == 2
        assert message in refused.err
        assert refused.err.count("\n") == 1
    assert list(Path().iterdir()) == []
