"""How a study DB in an SQLite file is opened, and what is said of one that cannot be read or written."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import optuna
import sqlalchemy as sa

from metaid.errors import StorageError
from metaid.store.optuna_tables import SCHEMA_VERSION

BUSY_TIMEOUT = 60  # s to wait for another program's write, unless the URL says otherwise: sqlite:///FILE?timeout=5
TABLES = {"studies", "trials", "version_info", "alembic_version"}  # of any study DB
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


def sqlite_options(url: sa.URL) -> dict[str, Any]:
    """How SQLAlchemy opens the file. What the URL says goes first."""
    return {} if "timeout" in url.query else {"connect_args": {"timeout": BUSY_TIMEOUT}}


def describe(problem: BaseException) -> str:
    """What an error of the DB says, in one line, and what can be done about it where that is known."""
    said = " ".join(str(problem).split())[:300]
    code = getattr(problem, "sqlite_errorcode", None)
    advice = None if code is None else ADVICE.get(code & 0xFF)  # the lower byte: the code without its refinement
    return said if advice is None else f"{said}; {advice}"


def has_tables(path: Path, create: bool) -> bool:
    """Whether the file holds a study DB; false if it is yet to be made, which `create` allows.  Raises StorageError,
    and has written nothing, where the file is missing or is something else.
    """
    try:
        there = path.exists()
    except OSError as problem:  # a name that no file system takes
        raise StorageError(f"{path}: not a study DB that can be read: {problem.strerror}") from None
    if not there:
        if not create:
            raise StorageError(
                f"no study DB at {path}: make a study with 'metaid study create', or name another with --storage"
            )
        if not path.parent.is_dir():
            raise StorageError(f"{path}: no such folder {path.parent}")
        return False
    if not path.is_file():
        raise StorageError(f"{path}: not a file, so not a study DB")
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as connection:
            tables = {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            if tables >= TABLES:
                _check_version(connection, path)
    except (sqlite3.Error, ValueError) as problem:  # a path or an SQL text that is no text, too
        raise StorageError(f"{path}: not a study DB that can be read: {describe(problem)}") from None
    if tables and not tables >= TABLES:
        raise StorageError(f"{path}: an SQLite file, but not a study DB")
    if not tables and not create:
        raise StorageError(f"{path}: an empty file, not a study DB")
    return bool(tables)


def _check_version(connection: sqlite3.Connection, path: Path) -> None:
    """Optuna's own check comes after it has added what it misses; this one changes nothing."""
    versions = connection.execute("SELECT schema_version, library_version FROM version_info").fetchall()
    revisions = connection.execute("SELECT version_num FROM alembic_version").fetchall()
    if len(versions) != 1 or len(revisions) != 1:
        raise StorageError(f"{path}: does not say which version of Optuna made it; {DAMAGED}")
    schema, library = versions[0]
    if schema != SCHEMA_VERSION:
        raise StorageError(
            f"{path}: made by Optuna {library} with tables of schema {schema} (allowed: {SCHEMA_VERSION}, that of "
            f"Optuna {optuna.__version__} here)"
        )


def make_file(path: Path, fill: Callable[[Path], None]) -> None:
    """A new file at `path`, made whole by `fill` under another name first: one that is there has all its tables. One
    that another program has made meanwhile is left alone.  Raises StorageError.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        fill(partial)
        os.link(partial, path)
    except FileExistsError:
        return
    except OSError as problem:
        raise StorageError(f"{path}: cannot be made: {problem.strerror}") from None
    finally:
        for file in (partial, partial.with_name(f"{partial.name}-journal")):
            file.unlink(missing_ok=True)


def use_wal(connection: Any, _record: Any) -> None:
    """Readers see the last whole transaction while the next is written; a power cut may cost the last ones, never the
    file.
    """
    with closing(connection.cursor()) as cursor:
        cursor.execute("PRAGMA journal_mode=WAL")
        cursor.execute("PRAGMA synchronous=NORMAL")
