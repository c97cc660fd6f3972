"""A study DB on a database server: its URL without the password, the connection, tables that one program at a time
makes, and whether the server answers.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import sqlalchemy as sa
from sqlalchemy.exc import SQLAlchemyError

from metaid.errors import StorageError, how_to_install
from metaid.store.optuna_tables import REVISION, SCHEMA_VERSION
from metaid.store.sqlite import MISSING, TABLES

PATIENT = {"connect_timeout": 10, "keepalives_idle": 30, "keepalives_interval": 10, "keepalives_count": 3}  # s
LONGEST_SILENCE = 60  # s in a transaction, in waiting for another one, and until what was sent has arrived
LOUD = "psycopg", "sqlalchemy.pool"  # they log a traceback where a connection is lost; the error says so already
MAKING_TABLES = 0x6D657461  # an advisory lock's number: any, but the same for all who make them


def without_password(storage: str) -> str:
    """A storage as it may be shown: whatever stands for a password is ***, also in a URL that is not one."""
    masked = re.sub(r"(?<=://)([^:/]*):.*@", r"\1:***@", storage)
    return re.sub(r"(?<=[?&])(password|sslpassword)=[^&#]*", r"\1=***", masked) if "://" in storage else masked


def parsed_url(url: str) -> sa.URL:
    """Raises StorageError where it is not the URL of a DB."""
    shown = without_password(url)
    try:
        parsed = sa.engine.make_url(url)
        parsed.get_dialect()
    except (SQLAlchemyError, ValueError):
        allowed = "a file path, or a URL such as sqlite:///metaid.db or postgresql://user:password@host/database"
        raise StorageError(f"{shown}: not a storage (allowed: {allowed})") from None
    if "@" in (parsed.host or ""):
        raise StorageError(f"{shown}: not a storage: an @ in a password is written as %40")
    return parsed


def missing_driver(url: sa.URL, problem: ImportError) -> str:
    """What is said of a server's driver that cannot be imported."""
    if url.get_backend_name() == "postgresql":
        return f"PostgreSQL's driver is not installed: {how_to_install('postgresql')} ({problem})"
    return f"no driver for this DB is installed ({problem})"


def server_options(url: sa.URL) -> dict[str, Any]:
    """How SQLAlchemy connects to a server: a connection that the server closed is opened again, and a server that has
    vanished is noticed. What the URL says goes first.
    """
    for name in LOUD:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if url.get_backend_name() != "postgresql":
        return {"pool_pre_ping": True}
    settings = {**PATIENT, "tcp_user_timeout": LONGEST_SILENCE * 1000, "fallback_application_name": "metaid"}
    given = {key: value for key, value in settings.items() if key not in url.query}
    return {"pool_pre_ping": True, "connect_args": given}


@contextmanager
def checked_tables(url: sa.URL, create: bool) -> Iterator[tuple[bool, bool]]:
    """Whether a PostgreSQL database holds a study DB, and whether its tables are of the revision that Optuna has; if
    there is none, and `create` allows one, nobody else makes one meanwhile.

    Raises StorageError, and has written nothing, where there is none to be read.
    """
    engine = sa.create_engine(url, **server_options(url))
    try:
        with engine.begin() as connection:
            if create:
                connection.execute(sa.select(sa.func.pg_advisory_xact_lock(MAKING_TABLES)))
            made = set(sa.inspect(connection).get_table_names()) >= TABLES
            if not made and not create:
                shown = without_password(url.render_as_string(hide_password=False))
                raise StorageError(f"no study DB at {shown}: {MISSING}")
            yield made, made and _is_current(connection)
    finally:
        engine.dispose()


def _is_current(connection: sa.Connection) -> bool:
    """Whether the tables are of the revision that Optuna has: where not, it is for Optuna to say why."""
    said = [
        connection.exec_driver_sql(f"SELECT {column} FROM {table}").scalars().all()
        for table, column in (("version_info", "schema_version"), ("alembic_version", "version_num"))
    ]
    return said == [[SCHEMA_VERSION], [REVISION]]


def end_when_silent(connection: Any, _record: Any) -> None:
    """Makes PostgreSQL end a transaction whose program is silent for too long, and one that waits for its lock."""
    with closing(connection.cursor()) as cursor:
        for setting in ("idle_in_transaction_session_timeout", "lock_timeout"):
            cursor.execute(f"SET {setting} = '{LONGEST_SILENCE}s'")
    connection.commit()  # a setting of a transaction that is rolled back would be gone


def does_not_answer(problem: BaseException, driver: Any) -> bool:
    """Whether an error says that the server is not there now: lost, refused, starting or shutting down. `driver` is
    the module that talks to it.
    """
    if getattr(problem, "connection_invalidated", False):
        return True
    cause = getattr(problem, "orig", None) or problem
    state = getattr(cause, "sqlstate", None)
    if not isinstance(cause, driver.OperationalError):
        return False
    # Without a state the connection was not made; 08 are connection exceptions, 57P01 to 57P03 shutdown and start.
    return state is None or state.startswith(("08", "57P01", "57P02", "57P03"))
