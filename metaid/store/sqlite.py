"""How a study DB in an SQLite file is opened, what is said of one that cannot be read or written, and whether the file
is still where it was.
"""

from __future__ import annotations

import errno
import os
import re
import shlex
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import optuna
import sqlalchemy as sa

from metaid.errors import StorageError, unknown
from metaid.store.optuna_tables import REVISION, SCHEMA_VERSION

BUSY_TIMEOUT = 60  # s to wait for another program's write, unless the URL says otherwise: sqlite:///FILE?timeout=5
TABLES = {"studies", "trials", "version_info", "alembic_version"}  # of any study DB
MISSING = "make a study with 'metaid study create', or name another with --storage"
DAMAGED = "the file is damaged: put a copy back, or save what can be read with: sqlite3 FILE .recover"
ADVICE = {
    sqlite3.SQLITE_BUSY: "another program is writing to it, or holds it: try again when that one is done",
    sqlite3.SQLITE_READONLY: "the file and its folder have to be writable: make them so, or copy it to where they are",
    sqlite3.SQLITE_CANTOPEN: "the file and its folder have to be writable: make them so, or copy it to where they are",
    sqlite3.SQLITE_FULL: "what was written before is safe: make room and go on",
    sqlite3.SQLITE_IOERR: "what was written before is safe: see to the disk, which is full or failing, and go on",
    sqlite3.SQLITE_CORRUPT: DAMAGED,
    sqlite3.SQLITE_NOTADB: "it is something else, or damaged: put a copy back",
}
COMPANIONS = ("-wal", "-shm")  # SQLite's own files beside the DB: it ends with them as long as somebody has it open
Identity = tuple[int, int]  # of a file, wherever it is moved: its device and its inode


def file_of(url: sa.URL) -> Path:
    """The file that an SQLite URL names.  Raises StorageError where it names none, or has options that metaid does not
    know.
    """
    shown = url.render_as_string()
    if url.drivername not in ("sqlite", "sqlite+pysqlite") or url.host or url.username:
        raise StorageError(
            f"{shown}: not the URL of an SQLite file (allowed: sqlite:///FILE, or sqlite:////FOLDER/FILE)"
        )
    if url.database in (None, "", ":memory:"):
        raise StorageError(f"{shown}: a DB in memory would be gone when the command ends (allowed: the path of a file)")
    for option in url.query.keys() - {"timeout"}:
        raise StorageError(f"{shown}: {unknown('option', option, ['timeout'])}; a ? in a file's name is written as %3F")
    return Path(url.database)


def sqlite_options(url: sa.URL) -> dict[str, Any]:
    """How SQLAlchemy opens the file. What the URL says goes first."""
    return {} if "timeout" in url.query else {"connect_args": {"timeout": BUSY_TIMEOUT}}


def describe(problem: BaseException) -> str:
    """What an error of the DB says, in one line, and what can be done about it where that is known."""
    said = " ".join(str(problem).split())[:300]
    code = getattr(problem, "sqlite_errorcode", None)
    advice = None if code is None else ADVICE.get(code & 0xFF)  # the lower byte: the code without its refinement
    return said if advice is None else f"{said}; {advice}"


def has_tables(path: Path, create: bool) -> tuple[bool, bool]:
    """Whether the file holds a study DB, false if it is yet to be made, which `create` allows; and whether its tables
    are of the revision that Optuna has: where not, it is for Optuna to say why.  Raises StorageError, and has written
    nothing, where the file is missing or is something else.
    """
    try:
        there = path.exists()
    except OSError as problem:  # a name that no file system takes
        raise StorageError(f"{path}: not a study DB that can be read: {problem.strerror}") from None
    if not there:
        if not create:
            raise StorageError(f"no study DB at {path}: {MISSING}")
        if not path.parent.is_dir():
            raise StorageError(f"{path}: no such folder {path.parent}")
        return False, False
    if not path.is_file():
        raise StorageError(f"{path}: not a file, so not a study DB")
    is_current = False
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as connection:
            tables = {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            if tables >= TABLES:
                is_current = _is_current(connection, path)
    except (sqlite3.Error, ValueError) as problem:  # a path or an SQL text that is no text, too
        raise StorageError(f"{path}: not a study DB that can be read: {describe(problem)}") from None
    if tables and not tables >= TABLES:
        raise StorageError(f"{path}: an SQLite file, but not a study DB")
    if not tables and not create:
        raise StorageError(f"{path}: an empty file, not a study DB")
    return bool(tables), is_current


def _is_current(connection: sqlite3.Connection, path: Path) -> bool:
    """Whether the tables are of the revision that Optuna has.  Raises StorageError where their schema is another.

    Optuna's own check comes after it has added what it misses; this one changes nothing.
    """
    versions = connection.execute("SELECT schema_version, library_version FROM version_info").fetchall()
    revisions = connection.execute("SELECT version_num FROM alembic_version").fetchall()
    if len(versions) != 1 or len(revisions) != 1:
        raise StorageError(f"{path}: does not say which version of Optuna made it; {DAMAGED}")
    schema, library = versions[0]
    if schema != SCHEMA_VERSION:
        url = shlex.quote(sa.URL.create("sqlite", database=str(path)).render_as_string())
        how = f"optuna storage upgrade --storage {url}" if schema < SCHEMA_VERSION else "pip install --upgrade optuna"
        raise StorageError(
            f"{path}: made by Optuna {library} with tables of schema {schema} (allowed: {SCHEMA_VERSION}, that of "
            f"Optuna {optuna.__version__} here; keep a copy of the file and try: {how})"
        )
    return bool(revisions == [(REVISION,)])


def make_file(path: Path, content: bytes) -> bool:
    """Makes a new file at `path` with this `content`, written under another name first: one that is there is whole.
    Returns whether it did; a file that another program has made meanwhile is left alone.  Raises StorageError.
    """
    for companion in (path.with_name(path.name + ending) for ending in (*COMPANIONS, "-journal")):
        if companion.exists():  # SQLite would take what is in it for the new file's
            raise StorageError(
                f"{path}: cannot be made: {companion.name} is left of a DB that was here (put that DB back, or move "
                f"{companion.name} away)"
            )
    _remove_litter(path)
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with partial.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.link(partial, path)
    except FileExistsError:
        return False
    except OSError as problem:
        why = "the disk is full: make room" if problem.errno == errno.ENOSPC else problem.strerror
        raise StorageError(f"{path}: cannot be made: {why}") from None
    finally:
        partial.unlink(missing_ok=True)
    return True


def _remove_litter(path: Path) -> None:
    """Removes what programs that were killed while they made the file at `path` have left beside it."""
    ours = re.compile(rf"\.{re.escape(path.name)}\.(\d+)(-journal)?")
    with suppress(OSError):
        for file in path.parent.iterdir():
            found = ours.fullmatch(file.name)
            if found and not _is_running(int(found[1])):
                file.unlink(missing_ok=True)


def _is_running(process: int) -> bool:
    """Whether there is a process of that number; true where the system does not say."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True  # somebody else's
    return True


class OpenFile:
    """The SQLite file at a path, as it was when it was first opened: what SQLAlchemy calls when it is used.

    What is written to a file that has been deleted, moved or replaced is in no DB, and SQLite does not notice. The file
    is never opened here: to close it would take away the locks that SQLite has on it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path.absolute()
        self._opened = _identity(_stat(self._path))
        self._size = 0  # bytes, when it was last looked at; while it is in use it only grows

    def before_connect(self, _dialect: Any, _record: Any, arguments: list[Any], options: dict[str, Any]) -> None:
        """Keeps SQLite from making a new file in the place of one that has gone.

        Args:
            _dialect: of SQLAlchemy.
            _record: what the pool keeps of a connection.
            arguments: of the connection, changed here: the file.
            options: of the connection, changed here.

        Raises:
            StorageError: the file has gone, or is another one.
        """
        self._refuse_another()
        arguments[0], options["uri"] = f"{self._path.as_uri()}?mode=rw", True

    def after_connect(self, connection: Any, record: Any) -> None:
        """Readers see the last whole transaction while the next is written; a power cut may cost the last ones, never
        the file.
        """
        with closing(connection.cursor()) as cursor:
            cursor.execute("PRAGMA journal_mode=WAL")
            cursor.execute("PRAGMA synchronous=NORMAL")
            cursor.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchall()  # SQLite opens the companions to read
        record.info[COMPANIONS] = self._companions()

    def before_use(self, _connection: Any, record: Any, _proxy: Any) -> None:
        """Raises StorageError where the file, or a companion that the connection has opened, is not there any more."""
        self._refuse_another()
        for ending, opened, now in zip(COMPANIONS, record.info[COMPANIONS], self._companions(), strict=True):
            if opened != now:
                raise StorageError(
                    f"{self._path}: {self._path.name}{ending} was removed while the DB was in use: trials that were "
                    "only there may be lost, and are run again when you go on"
                )

    def _refuse_another(self) -> None:
        now = _stat(self._path)
        size = 0 if now is None else now.st_size
        if now is None or _identity(now) != self._opened or size < self._size:
            raise StorageError(
                f"{self._path}: the file was {'deleted or moved' if now is None else 'replaced'} while it was in use: "
                f"put it back, with {self._path.name}-wal if there is one, and go on; trials that were only in it are "
                "lost with it"
            )
        self._size = size

    def _companions(self) -> list[Identity | None]:
        return [_identity(_stat(self._path.with_name(self._path.name + ending))) for ending in COMPANIONS]


def _stat(path: Path) -> os.stat_result | None:
    """Of the file at `path` now; None where there is none."""
    try:
        return path.stat()
    except OSError:
        return None


def _identity(found: os.stat_result | None) -> Identity | None:
    """Which file was `found`; None where there was none."""
    return None if found is None else (found.st_dev, found.st_ino)
