"""Who runs a study: one driver at a time, known to all who share the DB.

A lease is a system attribute of the study. It is taken and given up in a transaction of its own, and renewed in the
transaction of every write. A dead driver does not hold it: on the machine that it ran on its process is gone, and on
another its heartbeat is older than EXPIRY.
"""

from __future__ import annotations

import contextlib
import os
import socket
import threading
import uuid
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, ClassVar

import sqlalchemy as sa
from pydantic import AwareDatetime, BaseModel, ConfigDict, ValidationError

from metaid.errors import StorageError
from metaid.store.database import Store
from metaid.store.optuna_tables import STUDY_SYSTEM_ATTRIBUTES
from metaid.store.ownership import remove_orphans

KEY = "metaid:lease"
EXPIRY = 60.0  # s without a heartbeat after which a driver on another machine counts as dead
INTERVAL = 15.0  # s between heartbeats of a driver that has nothing to write

_row = STUDY_SYSTEM_ATTRIBUTES.c
_held = sa.select(_row.value_json).where(_row.study_id == sa.bindparam("study"), _row.key == KEY)
_ours = (
    _row.study_id == sa.bindparam("study"),
    _row.key == KEY,
    _row.value_json.like(sa.bindparam("owner")),
)
_renew = sa.update(STUDY_SYSTEM_ATTRIBUTES).where(*_ours).values(value_json=sa.bindparam("lease"))
_release = sa.delete(STUDY_SYSTEM_ATTRIBUTES).where(*_ours)


class Driver(BaseModel):
    """Who holds a lease.

    `machine` names the running kernel and its process table; it is empty where the system does not say. `started` is
    when the process started, in that kernel's ticks. `since` and `heartbeat` are by the DB's clock.
    """

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid")

    token: str  # first, so that its row is found by how it begins
    host: str
    machine: str
    pid: int
    started: int
    since: AwareDatetime
    heartbeat: AwareDatetime

    def lives(self, now: datetime) -> bool:
        """Whether it may still be at work."""
        if self.machine and self.machine == _machine():
            # This process knows its own leases: one that it could not give up must not keep it from its study.
            own = self.pid == os.getpid()
            return _started(self.pid) == self.started and (not own or self.token in Lease.held_here)
        return abs(now - self.heartbeat) < timedelta(seconds=EXPIRY)

    def describe(self, now: datetime) -> str:
        """Who it is, since when, in words."""
        if self.machine and self.machine == _machine():
            where = f"by process {self.pid} on this machine"
        else:
            silent = abs(now - self.heartbeat).total_seconds()
            where = (
                f"by process {self.pid} on {self.host}, last heard of {silent:.0f} s ago (free after {EXPIRY:.0f} s of "
                "silence),"
            )
        return f"{where} since {self.since.astimezone(UTC):%Y-%m-%d %H:%M:%S} UTC"


class Lease:
    """A context manager that holds the study of a `name` in a `store` for this driver.  Raises StorageError, saying who
    runs it since when, where another does.
    """

    held_here: ClassVar[set[str]] = set()  # tokens that drivers of this process hold

    def __init__(self, store: Store, name: str) -> None:
        self.store = store
        self.name = name
        self._over = threading.Event()
        self._pulse = threading.Thread(target=self._beat, name="metaid-lease", daemon=True)

    def __enter__(self) -> Lease:
        with self.store.writing(self.name) as (connection, study_id):
            now = refuse_if_run(connection, study_id, self.name)
            if self.store.is_sqlite:
                remove_orphans(connection)
            self._ahead = now - datetime.now(UTC)
            self._driver = _this_driver(now)
            connection.execute(sa.delete(STUDY_SYSTEM_ATTRIBUTES).where(_row.study_id == study_id, _row.key == KEY))
            row = {"study_id": study_id, "key": KEY, "value_json": self._driver.model_dump_json()}
            connection.execute(sa.insert(STUDY_SYSTEM_ATTRIBUTES).values(**row))
            Lease.held_here.add(self._driver.token)
        self._pulse.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._pulse.join()
        Lease.held_here.discard(self._driver.token)
        # A lease that cannot be given up now is free once this process has ended, and to this process itself.
        with contextlib.suppress(StorageError), self.store.writing(self.name) as (connection, study_id):
            connection.execute(_release, self._values(study_id))

    def renew(self, connection: sa.Connection, study_id: int) -> None:
        """Shows, within the transaction of a write, that the study is still this driver's.  Raises StorageError if
        another has taken it meanwhile.
        """
        alive = self._driver.model_copy(update={"heartbeat": datetime.now(UTC) + self._ahead})
        values = {**self._values(study_id), "lease": alive.model_dump_json()}
        if connection.execute(_renew, values).rowcount == 1:
            return
        taker = _driver(connection.scalar(_held, {"study": study_id}))
        taken = "given up" if taker is None else f"taken over: it is being run {taker.describe(_clock(connection))}"
        raise StorageError(f"study '{self.name}': this driver gave no sign of life, and the study was {taken}")

    def _values(self, study_id: int) -> dict[str, Any]:
        return {"study": study_id, "owner": f'{{"token":"{self._driver.token}"%'}

    def _beat(self) -> None:
        """Shows every now and then that this driver is alive, however long its generations take."""
        while not self._over.wait(INTERVAL):
            # The next write needs the DB too, and says what is wrong with it.
            with contextlib.suppress(StorageError), self.store.writing(self.name) as (connection, study_id):
                self.renew(connection, study_id)


def refuse_if_run(connection: sa.Connection, study_id: int, name: str) -> datetime:
    """What time it is by the DB's clock, in a transaction over a `connection`.  Raises StorageError where a driver runs
    the study of that id and `name`: the message says who, and since when.
    """
    now, driver = _clock(connection), _driver(connection.scalar(_held, {"study": study_id}))
    if driver is not None and driver.lives(now):
        raise StorageError(f"study '{name}' is being run {driver.describe(now)}")
    return now


def _driver(lease: str | None) -> Driver | None:
    """Whom a lease names; None where there is no lease, or none that metaid would have written."""
    try:
        return Driver.model_validate_json(lease or "")
    except ValidationError:
        return None


def _this_driver(now: datetime) -> Driver:
    pid = os.getpid()
    return Driver(
        token=uuid.uuid4().hex,
        host=socket.gethostname(),
        machine=_machine(),
        pid=pid,
        started=_started(pid),
        since=now,
        heartbeat=now,
    )


def _clock(connection: sa.Connection) -> datetime:
    """What time it is for all who share the DB."""
    now: datetime = connection.execute(sa.select(sa.func.now())).scalar_one()
    return now.replace(tzinfo=UTC) if now.tzinfo is None else now.astimezone(UTC)


def _machine() -> str:
    """The running kernel and the process table that this process is in; empty where the system does not say."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip() + os.readlink("/proc/self/ns/pid")
    except OSError:
        return ""


def _started(pid: int) -> int:
    """When a process started, in the kernel's ticks; 0 if it is no more."""
    try:
        # The name before it may hold anything, blanks and brackets included.
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0
    return 0 if fields[0] in "ZX" else int(fields[19])
