"""The study DB: an ordinary Optuna study DB, written a generation at a time.

Optuna's storage makes its tables and checks its schema version; rows are written through Optuna's own tables, one
transaction per generation, so that a reader or a crash sees whole generations and never a RUNNING trial. Nothing in a
DB is ever unpickled.
"""

from __future__ import annotations

import json
import operator
import shlex
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from typing import Any

import sqlalchemy as sa
from optuna.distributions import FloatDistribution, distribution_to_json
from optuna.exceptions import OptunaError, StorageInternalError
from optuna.storages import RDBStorage
from optuna.study import StudyDirection
from sqlalchemy.exc import SQLAlchemyError

from metaid.errors import StorageError, UnreachableError, unknown
from metaid.models import Array
from metaid.store.opening import open_engine, optuna_storage
from metaid.store.optuna_tables import (
    STUDIES,
    STUDY_ATTRIBUTES,
    STUDY_DIRECTIONS,
    STUDY_SYSTEM_ATTRIBUTES,
    STUDY_TABLES,
    TRIAL_TABLES,
    TRIALS,
    unreadable,
)
from metaid.store.ownership import DIGEST, End, digest_of, end_of, remove_orphans
from metaid.store.reading import JOINTS_KEY, StoredTrials, read_trials
from metaid.store.rows import IDS_AFTER, SPOILED, detail_rows, head_rows, shown_trial
from metaid.store.server import does_not_answer, missing_driver, parsed_url, without_password
from metaid.store.sqlite import DAMAGED, describe
from metaid.store.trial import Trial

DEFAULT_STORAGE = "metaid.db"
COMPANION = " (thinned)"  # ends the name of a copy of a long study, for a browser
SPEC_KEY = "metaid:study"
MOST_SHOWN = 64  # trials of others whose motion is read
# Called with a transaction that is about to write to a study, and the study's id; raises where it must not.
WriteCheck = Callable[[sa.Connection, int], object]

_ATTRIBUTES = {True: STUDY_ATTRIBUTES, False: STUDY_SYSTEM_ATTRIBUTES}  # by who sees them
_NAMES = sa.select(STUDIES.c.study_name).order_by(STUDIES.c.study_id)
_STUDY = sa.select(STUDIES.c.study_id).where(STUDIES.c.study_name == sa.bindparam("study"))
_OWN_STUDY = _STUDY.join(STUDY_ATTRIBUTES).where(STUDY_ATTRIBUTES.c.key == SPEC_KEY)


def storage_url(storage: str) -> str:
    """The URL of a `storage` given as a URL or as the path of an SQLite file, whatever letters are in that path.

    Raises StorageError where it is no text.
    """
    try:
        return storage if "://" in storage else sa.URL.create("sqlite", database=storage).render_as_string()
    except UnicodeEncodeError:
        raise StorageError(f"{storage}: not a storage: its name is not UTF-8") from None


def study_attributes(spec: str, joint_count: int) -> dict[str, Any]:
    """The user attributes by which metaid knows a study: made from `spec` (JSON), of a plant with that many joints.
    The last of them says that it is metaid's.
    """
    return {JOINTS_KEY: joint_count, DIGEST: digest_of(spec), SPEC_KEY: json.loads(spec)}


def unchecked(connection: sa.Connection, study_id: int) -> None:
    """Allows any transaction to write: where no driver can be running the study."""


class Store:
    """A study DB by URL or path; `create` allows a new file.  Raises StorageError where it is missing or is not a
    study DB.
    """

    def __init__(self, storage: str, create: bool = False) -> None:
        self.shown = without_password(storage)  # as the user named it
        self.url = storage_url(self.shown)
        self._address = parsed_url(storage_url(storage))
        self.is_sqlite = self._address.get_backend_name() == "sqlite"
        self._driver: Any = sqlite3  # the module whose errors are translated
        with self._errors():
            self._engine = open_engine(self._address, create)
        self._driver = self._engine.dialect.dbapi
        self._statements: dict[Any, Any] = {}
        self._ends: dict[str, End] = {}  # of studies, as they were last seen

    @cached_property
    def optuna(self) -> RDBStorage:
        """Optuna's own storage of the same DB. Nothing but Optuna's tools and the trials of others need it."""
        with self._errors():
            return optuna_storage(self._address)

    def close(self) -> None:
        self._engine.dispose()
        if "optuna" in vars(self):
            self.optuna.engine.dispose()

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except ImportError as problem:
            raise StorageError(f"{self.url}: {missing_driver(self._address, problem)}") from None
        except (SQLAlchemyError, OptunaError, *unreadable(), RuntimeError, *SPOILED, self._driver.Error) as error:
            cause = (isinstance(error, StorageInternalError) and error.__cause__) or error
            said = describe(getattr(cause, "orig", None) or cause)
            said = said.replace("$STORAGE_URL", shlex.quote(self.url)) if self.is_sqlite else said
            away = not self.is_sqlite and does_not_answer(cause, self._driver)
            raise (UnreachableError if away else StorageError)(f"{self.url}: {said}") from None

    def check(self) -> None:
        """Raises StorageError if the file is damaged: nothing should be written to it then."""
        if self.is_sqlite:
            with self._errors(), self._engine.connect() as connection:
                found = connection.exec_driver_sql("PRAGMA quick_check(1)").scalar_one()
            if found != "ok":
                raise StorageError(f"{self.url}: {str(found).splitlines()[-1]}; {DAMAGED}")

    def check_written(self, name: str, count: int) -> None:
        """Reads anew what a run has written.  Raises StorageError where the file is damaged, or the study has fewer
        than `count` trials: another file was copied over it in mid-run.
        """
        if self.is_sqlite:
            self._engine.dispose()  # what a connection remembers of the file would not show it
            self.check()
            if (found := self.count(name)) < count:
                raise StorageError(
                    f"{self.url}: study '{name}' has {found} trials where {count} were written: the file was replaced "
                    "while it was in use; go on to run them again"
                )

    def names(self) -> list[str]:
        """Names of the studies that metaid made, oldest first."""
        return self._names(_NAMES.join(STUDY_ATTRIBUTES).where(STUDY_ATTRIBUTES.c.key == SPEC_KEY))

    def other_names(self) -> list[str]:
        """Names of the Optuna studies that metaid did not make, oldest first, but for thinned companions of its own."""
        own = set(self.names())
        return [name for name in self._names(_NAMES) if not own & {name, name.removesuffix(COMPANION)}]

    def _names(self, query: sa.Select[Any]) -> list[str]:
        with self._errors(), self._engine.connect() as connection:
            return list(connection.scalars(query))

    def create(self, name: str, spec: str, joint_count: int) -> None:
        """A study of that `name` without trials, made from `spec` (JSON), whose plant has `joint_count` joints, in one
        transaction.  Raises StorageError if there is one.
        """
        with self._errors(), self._engine.begin() as connection:
            if connection.scalar(_STUDY, {"study": name}) is not None:
                raise StorageError(
                    f"{self.url} has a study '{name}' already (choose another with --name, or delete it)"
                )
            if self.is_sqlite:
                remove_orphans(connection)
            study_id = connection.scalar(sa.insert(STUDIES).values(study_name=name).returning(STUDIES.c.study_id))
            connection.execute(
                sa.insert(STUDY_DIRECTIONS).values(direction=StudyDirection.MINIMIZE, study_id=study_id, objective=0)
            )
            attributes = study_attributes(spec, joint_count)
            rows = [{"study_id": study_id, "key": key, "value_json": json.dumps(v)} for key, v in attributes.items()]
            connection.execute(sa.insert(STUDY_ATTRIBUTES), rows)

    def spec(self, name: str) -> str:
        """The JSON that the study was made from."""
        return str(self._text(STUDY_ATTRIBUTES, name, SPEC_KEY))

    def attribute(self, name: str, key: str, shown: bool = True) -> Any:
        """What an attribute of the study says, one that Optuna's tools have `shown` or one that they do not show; None
        where it has none of that `key`.
        """
        text = self._text(_ATTRIBUTES[shown], name, key)
        with self._errors():
            return None if text is None else json.loads(text)

    def _text(self, attribute: sa.Table, name: str, key: str) -> str | None:
        of_study = attribute.c.study_id == self._study_id(name)
        with self._errors(), self._engine.connect() as connection:
            return connection.scalar(sa.select(attribute.c.value_json).where(of_study, attribute.c.key == key))

    def set_attribute(
        self, name: str, key: str, value: Any, shown: bool = True, write_check: WriteCheck = unchecked
    ) -> None:
        """Gives the study an attribute, in place of the one that it has of that `key`.

        Args:
            name: the study's.
            key: the attribute's.
            value: of it, as JSON can say it.
            shown: whether Optuna's tools show it.
            write_check: called within the transaction, before anything is written; raises where it must not be.
        """
        attribute = _ATTRIBUTES[shown]
        with self.writing(name) as (connection, study_id):
            write_check(connection, study_id)
            connection.execute(sa.delete(attribute).where(attribute.c.study_id == study_id, attribute.c.key == key))
            row = {"study_id": study_id, "key": key, "value_json": json.dumps(value)}
            connection.execute(sa.insert(attribute).values(row))

    @contextmanager
    def writing(self, name: str) -> Iterator[tuple[sa.Connection, int]]:
        """A transaction during which no other program writes to the study or its lease, and the study's id."""
        with self._errors(), self._engine.begin() as connection:
            self._lock(connection, name)
            study_id = connection.scalar(_STUDY, {"study": name})
            if study_id is None:
                raise StorageError(f"study '{name}' is no longer there")
            yield connection, study_id

    def _lock(self, connection: sa.Connection, name: str) -> None:
        """Keeps other programs from writing to the study until the transaction ends; called before anything is read."""
        if self.is_sqlite:
            connection.exec_driver_sql("BEGIN IMMEDIATE")
        else:
            connection.execute(_STUDY.with_for_update(), {"study": name})

    def delete(self, name: str, write_check: WriteCheck) -> None:
        """Deletes a study and its trials, unless `write_check` raises."""
        self._study_id(name)  # raises for a study that metaid did not make
        with self.writing(name) as (connection, study_id):
            write_check(connection, study_id)
            trials = sa.select(TRIALS.c.trial_id).where(TRIALS.c.study_id == study_id)
            for table in TRIAL_TABLES:
                connection.execute(sa.delete(table).where(table.c.trial_id.in_(trials)))
            for table in STUDY_TABLES:
                connection.execute(sa.delete(table).where(table.c.study_id == study_id))
            connection.execute(sa.delete(STUDIES).where(STUDIES.c.study_id == study_id))

    def append(
        self,
        name: str,
        names: Sequence[str],
        low: Array,
        high: Array,
        trials: Sequence[Trial],
        write_check: WriteCheck = unchecked,
    ) -> None:
        """Adds finished trials in one transaction.

        Args:
            name: the study's.
            names: under which the factors are stored (nsearched).
            low: the least that each factor may be (nsearched).
            high: the largest that each factor may be (nsearched).
            trials: in order; the first follows the last one in the DB.
            write_check: called within the transaction, before anything is written; raises where it must not be.

        Raises:
            StorageError: where the trials do not follow the last one: another program has written to the study.
                Nothing is written then.
        """
        distributions = [
            distribution_to_json(FloatDistribution(a, b)) for a, b in zip(low.tolist(), high.tolist(), strict=True)
        ]
        with self._errors(), self._engine.begin() as connection:
            self._lock(connection, name)
            end = self._end(connection, name)
            write_check(connection, end.study_id)
            if end.count != trials[0].number:
                raise StorageError(
                    f"study '{name}' has {end.count} trials where {trials[0].number} were expected: "
                    "another program has written to it"
                )
            self._insert(connection, TRIALS, head_rows(end, trials))
            ids = list(connection.scalars(IDS_AFTER, {"study_id": end.study_id, "last_id": end.last_id}))
            for table, rows in detail_rows(ids, trials, names, distributions, end.digest).items():
                self._insert(connection, table, rows)

    def _end(self, connection: sa.Connection, name: str) -> End:
        self._ends[name] = end = end_of(connection, name, self._ends.get(name))
        return end

    def count(self, name: str) -> int:
        """How many trials of metaid's a study has."""
        with self._errors(), self._engine.connect() as connection:
            return self._end(connection, name).count

    def _insert(self, connection: sa.Connection, table: sa.Table, rows: list[dict[str, Any]]) -> None:
        """Inserts `rows`, all with the same columns and of types that the driver knows.

        SQLAlchemy makes the statement once; preparing each row anew, as it would, takes longer than writing it.
        """
        if table not in self._statements:
            self._statements[table] = sa.insert(table).compile(self._engine, column_keys=list(rows[0]))
        statement = self._statements[table]
        if statement.positiontup is None:
            connection.exec_driver_sql(statement.string, rows)
        else:
            order = operator.itemgetter(*statement.positiontup)
            connection.exec_driver_sql(statement.string, [order(row) for row in rows])

    def trials(self, name: str, names: Sequence[str]) -> list[Trial]:
        """All trials of metaid's in order, with their factors in the order of `names`."""
        return self.read(name, names).own

    def read(self, name: str, names: Sequence[str]) -> StoredTrials:
        """The same, and the trials of the study that are others', the first MOST_SHOWN that carry motion with it."""
        study_id = self._study_id(name)
        with self._snapshot() as connection:
            try:
                stored = read_trials(connection, study_id, names)
            except SPOILED:
                raise StorageError(f"{self.url}: study '{name}' has trials that are not as metaid wrote them") from None
        if not stored.with_motion:
            return stored
        with self._errors():
            frozen = (self.optuna.get_trial(trial_id) for trial_id in list(stored.with_motion.values())[:MOST_SHOWN])
            shown = {trial.number: shown_trial(trial, names) for trial in frozen}
        return replace(stored, foreign=tuple(replace(each, shown=shown.get(each.number)) for each in stored.foreign))

    @contextmanager
    def _snapshot(self) -> Iterator[sa.Connection]:
        """A connection whose reads all see the DB as it was at the first, whatever is written meanwhile."""
        level = {} if self.is_sqlite else {"isolation_level": "REPEATABLE READ"}
        with self._errors(), self._engine.connect().execution_options(**level) as connection:
            if self.is_sqlite:
                connection.exec_driver_sql("BEGIN")  # Python's driver would begin no transaction to read
            yield connection

    def _study_id(self, name: str) -> int:
        with self._errors(), self._engine.connect() as connection:
            study_id = connection.scalar(_OWN_STUDY, {"study": name})
        if study_id is None:
            raise StorageError(f"{self.url}: {unknown('study', name, self.names())}")
        return int(study_id)
