"""How a study DB is opened, by its URL: an SQLite file, a PostgreSQL database, or another that Optuna knows."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from contextlib import contextmanager

import optuna
import sqlalchemy as sa
from optuna.storages import RDBStorage

from metaid.store.server import checked_tables, end_when_silent, server_options
from metaid.store.sqlite import (
    OpenFile,
    file_of,
    has_tables,
    make_file,
    sqlite_options,
)


def open_storage(url: sa.URL, create: bool) -> RDBStorage:
    """Optuna's storage, its tables made if need be and its schema checked.  Raises StorageError where there is no study
    DB and `create` does not allow one, and whatever Optuna, SQLAlchemy and the driver raise.
    """
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    options = sqlite_options(url) if url.get_backend_name() == "sqlite" else server_options(url)
    with _tables(url, create) as (made, checked):
        storage = RDBStorage(
            url.render_as_string(hide_password=False),
            engine_kwargs=options,
            skip_compatibility_check=checked,
            skip_table_creation=made,
        )
    _prepare(storage.engine)
    return storage


def _prepare(engine: sa.Engine) -> None:
    """Says what is done with every new connection, and before one is used again."""
    if engine.url.get_backend_name() == "sqlite":
        file = OpenFile(file_of(engine.url))
        sa.event.listen(engine, "do_connect", file.before_connect)
        sa.event.listen(engine, "connect", file.after_connect)
        sa.event.listen(engine, "checkout", file.before_use)
    elif engine.url.get_backend_name() == "postgresql":
        sa.event.listen(engine, "connect", end_when_silent)
    engine.dispose()  # so that the connection that checked the schema is opened again, prepared


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
        with checked_tables(url, create) as made:
            yield made, False
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
