"""A real PostgreSQL server on loopback that can be stopped and started, with databases of their own for tests."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import psycopg
import pytest

PASSWORD = "a pass/word@home"  # what has to be quoted in a URL, and must never be shown
QUOTED = "a%20pass%2Fword%40home"
QUICK = ("-c", "fsync=off", "-c", "full_page_writes=off", "-c", "shared_buffers=16MB", "-c", "max_connections=40")


class Postgres:
    """A server with its files in `folder`, which is not yet started."""

    def __init__(self, binaries: Path, folder: Path) -> None:
        self._binaries = binaries
        self._folder = folder
        self._process: subprocess.Popen[bytes] | None = None
        self._numbers = count(1)
        with closing(socket.socket()) as free:
            free.bind(("127.0.0.1", 0))
            self.port: int = free.getsockname()[1]
        secret = folder / "password"
        secret.write_text(PASSWORD)
        make = [binaries / "initdb", "-D", folder / "data", "-U", "metaid", "--pwfile", secret, "-A", "scram-sha-256"]
        subprocess.run([*make, "--locale=C", "-E", "UTF8", "-N"], check=True, capture_output=True, **_nobody(folder))

    def start(self) -> None:
        """Starts it, anew if it runs, and returns when it answers."""
        self.stop()
        with (self._folder / "log").open("ab") as log:
            self._process = subprocess.Popen(
                [
                    *(self._binaries / "postgres", "-D", self._folder / "data", "-p", str(self.port), *QUICK),
                    *("-c", "listen_addresses=127.0.0.1", "-c", "unix_socket_directories="),
                ],
                stdout=log,
                stderr=log,
                **_nobody(self._folder),
            )
        asked = [self._binaries / "pg_isready", "-q", "-h", "127.0.0.1", "-p", str(self.port), "-t", "5"]
        while subprocess.run(asked).returncode != 0:
            assert self._process.poll() is None, (self._folder / "log").read_text()

    def stop(self, how: signal.Signals = signal.SIGINT) -> None:
        """Stops it as `systemctl restart` does: whoever is connected is thrown out. SIGQUIT leaves all as it is."""
        if self._process is not None:
            self._process.send_signal(how)
            self._process.wait()
            self._process = None

    def new_database(self) -> str:
        """The URL of a database of its own, with its password."""
        name = f"studies_{next(self._numbers)}"
        self.ask("postgres", f"CREATE DATABASE {name}")
        return f"postgresql://metaid:{QUOTED}@127.0.0.1:{self.port}/{name}"

    def ask(self, database: str, statement: str) -> list[tuple[Any, ...]]:
        """The rows that a statement gives, if any, as any PostgreSQL tool would ask it."""
        connected = psycopg.connect(
            host="127.0.0.1", port=self.port, user="metaid", password=PASSWORD, dbname=database, autocommit=True
        )
        with closing(connected) as connection, connection.cursor() as cursor:
            cursor.execute(statement.encode())
            return cursor.fetchall() if cursor.description else []


def _nobody(folder: Path) -> dict[str, Any]:
    """Who the server runs as: it refuses to be run by root."""
    if os.geteuid() != 0:
        return {"cwd": folder}
    user = pwd.getpwnam("nobody")
    return {"cwd": folder, "user": user.pw_uid, "group": user.pw_gid, "extra_groups": []}


def _binaries() -> Path:
    """Where initdb and postgres are; Debian keeps them, by version, out of the way of others."""
    found = shutil.which("initdb")
    folders = [Path(found).resolve().parent] if found else sorted(Path("/usr/lib/postgresql").glob("*/bin"))
    folders = [folder for folder in folders if (folder / "initdb").exists() and (folder / "postgres").exists()]
    if not folders:
        needs = "needs a PostgreSQL server (Debian: apt-get install postgresql)"
        (pytest.fail if os.environ.get("METAID_POSTGRESQL") == "required" else pytest.skip)(needs)
    return folders[-1]


@contextmanager
def run_postgres() -> Iterator[Postgres]:
    """A server, started. Without one on this machine the test is skipped, or fails where it must not be
    (METAID_POSTGRESQL=required, which .ci/run sets).
    """
    binaries = _binaries()
    # Not pytest's own folder, which nobody but its user may enter.
    with tempfile.TemporaryDirectory(prefix="metaid-postgres-") as folder:
        if os.geteuid() == 0:
            shutil.chown(folder, "nobody")
        server = Postgres(binaries, Path(folder))
        try:
            server.start()
            yield server
        finally:
            server.stop(signal.SIGQUIT)
