"""What happens to a DB's file costs one clear line, never what was in it; mended, the run goes on as if nothing had."""

from __future__ import annotations

import hashlib
import os
import shutil
import signal
import sqlite3
import subprocess
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from random import Random

import pandas as pd
import pytest
from conftest import Finished
from forked import Command
from pandas.testing import assert_frame_equal

from metaid import results
from metaid.store import Store
from metaid.store.optuna_tables import REVISION
from metaid.study import create_study, load_study, run_study

pytestmark = pytest.mark.slow

CHANGES = {"trials": 450, "search.coordinates": "plain", "search.start": 0.8, "episode.fall_limit": 1.0}
HALF = 225  # trials: whole generations
GENERATION = 9
Metaid = Callable[..., Finished]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, pd.DataFrame]:
    """A DB with half of a study, not to be changed, and the trials of all of it."""
    folder = tmp_path_factory.mktemp("made")
    with closing(Store(str(folder / "half.db"), create=True)) as store:
        create_study(store, load_study("three-link-coast", CHANGES), "study")
        run_study(store, "study", trials=HALF)
    shutil.copy(folder / "half.db", folder / "whole.db")
    with closing(Store(str(folder / "whole.db"))) as store:
        run_study(store, "study")
        return folder / "half.db", results.trials_frame(store, "study")


@pytest.fixture
def half(made: tuple[Path, pd.DataFrame], tmp_path: Path) -> Path:
    """A copy of the half study, `metaid.db` in the folder where commands run."""
    return Path(shutil.copy(made[0], tmp_path / "metaid.db"))


@pytest.fixture
def whole(made: tuple[Path, pd.DataFrame]) -> pd.DataFrame:
    """The trials of the whole study, run without a fault."""
    return made[1]


@contextmanager
def small_disk(folder: Path, kilobytes: int) -> Iterator[Path]:
    """A file system of its own, in memory."""
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", folder]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True).returncode != 0:
        pytest.skip("a small or read-only disk has to be mounted, which is not allowed here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", folder], check=True)


def refused(done: Finished) -> str:
    """What a command said that could not do its work: one line, status 2."""
    assert done.status == 2
    assert "Traceback" not in done.err
    said = done.err.strip()
    assert len(said.splitlines()) == 1
    assert said.startswith("metaid: ")
    return said


def trials_of(path: Path) -> pd.DataFrame:
    """The trial table of a DB that has to be whole."""
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    with closing(Store(str(path))) as store:
        return results.trials_frame(store, "study")


def assert_goes_on(metaid: Metaid, path: Path, whole: pd.DataFrame) -> None:
    """The run ends with the table of one that nothing happened to."""
    assert metaid("study", "run", "study", "--quiet", "--storage", str(path)).status == 0
    assert_frame_equal(trials_of(path), whole, check_exact=True)


def content(path: Path) -> str:
    """What is in a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


COMMANDS = (
    ["study", "run", "study"],
    ["study", "create", "two-link-tpe"],
    ["study", "delete", "study", "--yes"],
)


def test_read_only_db_is_told_as_such_and_left_alone(
    metaid: Metaid, half: Path, whole: pd.DataFrame, tmp_path: Path
) -> None:
    """On a disk that is mounted read-only nothing can be written, whoever one is."""
    with small_disk(tmp_path / "disk", 8000) as disk:
        path = Path(shutil.copy(half, disk))
        subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
        before = content(path)
        for command in (*COMMANDS, ["study", "show", "study"]):
            assert "the file and its folder have to be writable" in refused(metaid(*command, "--storage", str(path)))
        assert content(path) == before
        subprocess.run(["mount", "-o", "remount,rw", disk], check=True)
        assert_goes_on(metaid, path, whole)


def test_full_disk_in_mid_run_leaves_whole_generations_and_the_run_goes_on_with_more_room(
    metaid: Metaid, half: Path, whole: pd.DataFrame, tmp_path: Path
) -> None:
    """What was written before can be read, on the full disk as well."""
    with small_disk(tmp_path / "disk", half.stat().st_size // 1024 + 450) as disk:
        path = Path(shutil.copy(half, disk))
        run = "study", "run", "study", "--quiet", "--storage", str(path)
        assert "is full; what was written before is safe: make room" in refused(metaid(*run))
        found = trials_of(path)
        assert HALF <= len(found) < len(whole)
        assert len(found) % GENERATION == 0
        assert_frame_equal(found, whole.iloc[: len(found)], check_exact=True)
        assert "is full; what was written before is safe: make room" in refused(metaid(*run))
        subprocess.run(["mount", "-o", "remount,size=16m", disk], check=True)
        assert_goes_on(metaid, path, whole)


def test_full_disk_from_the_first_byte(metaid: Metaid, half: Path, whole: pd.DataFrame, tmp_path: Path) -> None:
    """Where there is no room for anything, nothing is made and nothing lost."""
    with small_disk(tmp_path / "disk", 8000) as disk:
        path = Path(shutil.copy(half, disk))
        try:
            with (disk / "filler").open("wb", buffering=0) as filler:
                while filler.write(b"x" * 4096) == 4096:
                    pass
        except OSError:
            pass
        before = content(path)
        for command in COMMANDS:
            assert "full" in refused(metaid(*command, "--storage", str(path)))
        assert "is full" in refused(metaid("study", "create", "three-link-coast", "--storage", str(disk / "new.db")))
        assert content(path) == before
        assert not (disk / "new.db").exists()
        (disk / "filler").unlink()
        assert_goes_on(metaid, path, whole)


def test_locked_db_is_waited_for_and_then_told(metaid: Metaid, half: Path, whole: pd.DataFrame) -> None:
    """Another program holds the write lock for longer than the timeout in the URL."""
    with closing(sqlite3.connect(half, isolation_level=None)) as other:
        other.execute("PRAGMA journal_mode=WAL")
        other.execute("BEGIN IMMEDIATE")
        for command in COMMANDS:
            said = refused(metaid(*command, "--storage", f"sqlite:///{half}?timeout=0.2"))
            assert "database is locked; another program is writing to it, or holds it" in said
        other.execute("ROLLBACK")
    assert len(trials_of(half)) == HALF
    assert_goes_on(metaid, half, whole)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("UPDATE alembic_version SET version_num = 'v9.9.9.a'", "try updating optuna"),
        ("UPDATE alembic_version SET version_num = 'v9.9.9.a'; DROP TABLE trial_heartbeats", "try updating optuna"),
        ("UPDATE version_info SET schema_version = 99, library_version = '9.9.9'", "made by Optuna 9.9.9"),
        ("UPDATE version_info SET schema_version = 99", "try: pip install --upgrade optuna)"),
        ("UPDATE alembic_version SET version_num = 'v3.0.0.c'", "`$ optuna storage upgrade --storage sqlite:///"),
        ("UPDATE version_info SET schema_version = 10", "try: optuna storage upgrade --storage sqlite:///"),
        ("DELETE FROM alembic_version", "does not say which version"),
        ("DELETE FROM version_info", "does not say which version"),
        ("INSERT INTO alembic_version VALUES ('v9.9.9.a')", "does not say which version"),
        ("DROP TABLE alembic_version", "but not a study DB"),
    ],
)
def test_db_of_another_optuna_is_told_as_such_and_left_alone(
    metaid: Metaid, half: Path, change: str, message: str
) -> None:
    """Its tables may mean something else: nothing is read or written, nor made that is missing."""
    with closing(sqlite3.connect(half)) as connection:
        connection.executescript(change)
    before = content(half)
    for command in (*COMMANDS, ["study", "show", "study"]):
        assert message in refused(metaid(*command))
    assert content(half) == before


def overwritten(path: Path, seed: int) -> None:
    """Noise over the first half of some page but the first."""
    random = Random(seed)
    with path.open("r+b") as file:
        file.seek(4096 * random.randrange(1, path.stat().st_size // 4096))
        file.write(random.randbytes(2048))


def header_ruined(path: Path, _seed: int) -> None:
    """Noise over the header."""
    with path.open("r+b") as file:
        file.write(b"\x93" * 64)


def truncated(path: Path, seed: int) -> None:
    """What a copy is that was cut off."""
    os.truncate(path, Random(seed).randrange(1, path.stat().st_size))


def emptied(path: Path, _seed: int) -> None:
    """No byte left."""
    os.truncate(path, 0)


@pytest.mark.parametrize(
    ("damage", "seed"),
    [*((overwritten, i) for i in range(4)), *((truncated, i) for i in range(3)), (header_ruined, 0), (emptied, 0)],
)
def test_damaged_db_is_neither_run_nor_changed_and_goes_on_from_a_copy(
    metaid: Metaid, half: Path, whole: pd.DataFrame, damage: Callable[[Path, int], None], seed: int
) -> None:
    """Noise, a cut, nothing at all: what is left is not written to."""
    good = half.read_bytes()
    damage(half, seed)
    before = content(half)
    said = refused(metaid("study", "run", "study"))
    assert "damaged: put a copy back" in said or "an empty file" in said
    shown = metaid("study", "show", "study")  # which may not need what is damaged
    assert shown.status == 0 or refused(shown)
    assert content(half) == before
    half.write_bytes(good)
    assert_goes_on(metaid, half, whole)


def deleted(path: Path, _seed: int) -> None:
    """Not there any more."""
    path.unlink()


def test_lost_write_ahead_log_costs_generations_that_are_run_again(
    metaid: Metaid, half: Path, whole: pd.DataFrame, tmp_path: Path
) -> None:
    """What a kill left in the log and the disk then lost: an earlier state of the DB is gone on with."""
    first = "from soak.doomed import Doom; Doom(20, 3)"
    doomed = Command(tmp_path, "study", "run", "study", "--storage", str(half), first=first)
    assert doomed.wait() == -signal.SIGKILL
    for damage in (deleted, truncated, overwritten):
        folder = tmp_path / damage.__name__
        folder.mkdir()
        path = Path(shutil.copy(half, folder))
        damage(Path(shutil.copy(half.with_name("metaid.db-wal"), folder)), 1)
        found = trials_of(path)
        assert HALF <= len(found) < HALF + 19 * GENERATION
        assert_frame_equal(found, whole.iloc[: len(found)], check_exact=True)
        assert_goes_on(metaid, path, whole)
    assert len(trials_of(half)) == HALF + 19 * GENERATION


def test_revision_of_the_tables_is_optunas(tmp_path: Path) -> None:
    """A file of that revision is opened without Optuna's own check, and one of another is checked."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    assert store.optuna.get_head_version() == REVISION
