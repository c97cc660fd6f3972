"""How a study DB is opened, by its URL: an SQLite file, a PostgreSQL database, or another that Optuna knows."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import optuna
import sqlalchemy as sa
from optuna.storages import RDBStorage

from metaid.store.server import checked_tables, end_when_silent, server_options
from metaid.store.sqlite import OpenFile, file_of, has_tables, make_file, sqlite_options


def open_engine(url: sa.URL, create: bool) -> sa.Engine:
    """Connections to a study DB, its tables made if need be and its schema checked.  Raises StorageError where there is
    no study DB and `create` does not allow one, and whatever Optuna, SQLAlchemy and the driver raise.
    """
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    with _tables(url, create) as (made, is_known):
        if is_known:  # what makes and upgrades tables takes a tenth of a second to load
            engine = _prepared(sa.create_engine(url, **_options(url)))
            engine.connect().close()  # or SQLite's own files, which a look at the tables leaves, would stay
            return engine
        return _prepared(_storage(url, made, is_checked=False).engine)


def optuna_storage(url: sa.URL) -> RDBStorage:
    """Optuna's own storage of a study DB that has been opened."""
    storage = _storage(url, has_tables=True, is_checked=True)
    _prepared(storage.engine)
    return storage


def _storage(url: sa.URL, has_tables: bool, is_checked: bool) -> RDBStorage:
    return RDBStorage(
        url.render_as_string(hide_password=False),
        engine_kwargs=_options(url),
        skip_compatibility_check=is_checked,
        skip_table_creation=has_tables,
    )


def _options(url: sa.URL) -> dict[str, Any]:
    return sqlite_options(url) if url.get_backend_name() == "sqlite" else server_options(url)


def _prepared(engine: sa.Engine) -> sa.Engine:
    """The same, which knows what is done with every new connection, and before one is used again."""
    if engine.url.get_backend_name() == "sqlite":
        file = OpenFile(file_of(engine.url))
        sa.event.listen(engine, "do_connect", file.before_connect)
        sa.event.listen(engine, "connect", file.after_connect)
        sa.event.listen(engine, "checkout", file.before_use)
    elif engine.url.get_backend_name() == "postgresql":
        sa.event.listen(engine, "connect", end_when_silent)
    engine.dispose()  # so that the connection that checked the schema is opened again, prepared
    return engine


@contextmanager
def _tables(url: sa.URL, create: bool) -> Iterator[tuple[bool, bool]]:
    """Whether the tables are there, and whether their schema is known to be Optuna's own: a DB that is there is not
    changed before it is.
    """
    if url.get_backend_name() == "sqlite":
        path = file_of(url)
        made, is_known = has_tables(path, create)
        is_there = path.exists()
        if not is_there:
            is_known = make_file(path, _new_tables())
        yield made or not is_there, is_known
    elif url.get_backend_name() == "postgresql":
        with checked_tables(url, create) as found:
            yield found
    else:
        yield False, False


@functools.cache
def _new_tables() -> bytes:
    """A study DB without studies, as the content of an SQLite file."""
    engine = RDBStorage("sqlite:///:memory:").engine
    connection = engine.raw_connection()
    try:
        content: bytes = connection.driver_connection.serialize()  # type: ignore[union-attr]
    finally:
        connection.close()
        engine.dispose()
    return content
