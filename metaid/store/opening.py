"""How a study DB is opened, by its URL: an SQLite file, a PostgreSQL database, or another that Optuna knows."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import optuna
import sqlalchemy as sa
from optuna.storages import RDBStorage

from metaid.store.server import checked_tables, end_when_silent, server_options
from metaid.store.sqlite import has_tables, make_file, sqlite_options, use_wal

ON_CONNECT = {"sqlite": use_wal, "postgresql": end_when_silent}


def open_storage(url: sa.URL, create: bool) -> RDBStorage:
    """Optuna's storage, its tables made if need be and its schema checked.  Raises StorageError where there is no study
    DB and `create` does not allow one, and whatever Optuna, SQLAlchemy and the driver raise.
    """
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    options = sqlite_options(url) if url.get_backend_name() == "sqlite" else server_options(url)
    with _tables(url, create) as made:
        storage = RDBStorage(url.render_as_string(hide_password=False), engine_kwargs=options, skip_table_creation=made)
    if prepare := ON_CONNECT.get(url.get_backend_name()):
        sa.event.listen(storage.engine, "connect", prepare)
        storage.engine.dispose()  # so that the connection that checked the schema is opened again, prepared
    return storage


@contextmanager
def _tables(url: sa.URL, create: bool) -> Iterator[bool]:
    """Whether the tables are there: a DB that is there is not changed before its schema is known."""
    if url.get_backend_name() == "sqlite":
        path = Path(url.database or "")
        made = has_tables(path, create)
        if not path.exists():
            make_file(path, _make_tables)
            made = True
        yield made
    elif url.get_backend_name() == "postgresql":
        with checked_tables(url, create) as made:
            yield made
    else:
        yield False


def _make_tables(path: Path) -> None:
    RDBStorage(f"sqlite:///{path}").engine.dispose()
