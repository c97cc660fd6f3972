"""The study DB: an ordinary Optuna study DB, written a generation at a time.

Optuna's storage opens the DB, makes its tables and checks its schema version; rows are written through Optuna's own
SQLAlchemy model classes, one transaction per generation, so that a reader or a crash sees whole generations and never
a RUNNING trial. Nothing in a DB is ever unpickled.
"""

from __future__ import annotations

import json
import operator
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import sqlalchemy as sa
from numpy.typing import NDArray
from optuna.distributions import FloatDistribution, distribution_to_json
from optuna.storages import RDBStorage
from optuna.storages._rdb import models
from optuna.study import StudyDirection
from optuna.trial import TrialState
from sqlalchemy.exc import SQLAlchemyError

from metaid.chain import Array
from metaid.errors import StorageError, unknown
from metaid.objective import Outcome

DEFAULT_STORAGE = "metaid.db"
SPEC_KEY = "metaid:study"
BUSY_TIMEOUT = 60  # s


@dataclass(frozen=True)
class Trial:
    """One row of the trial table; `factors` (nlump)."""

    number: int
    generation: int
    factors: Array
    outcome: Outcome
    started: datetime | None = None
    completed: datetime | None = None


def storage_url(storage: str) -> str:
    """The URL of a `storage` given as a URL or as the path of an SQLite file."""
    return storage if "://" in storage else f"sqlite:///{storage}"


class Store:
    """A study DB by URL or path; `create` allows a new file.  Raises StorageError where it is missing or is not a
    study DB.
    """

    def __init__(self, storage: str, create: bool = False) -> None:
        self.url = storage_url(storage)
        try:
            parsed = sa.engine.make_url(self.url)
        except SQLAlchemyError:
            raise StorageError(
                f"{storage}: not a storage (allowed: a file path, or a URL such as sqlite:///metaid.db)"
            ) from None
        self.is_sqlite = parsed.get_backend_name() == "sqlite"
        if self.is_sqlite:
            _check_sqlite_file(Path(parsed.database or ""), create)
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        with self._errors():
            options = {"connect_args": {"timeout": BUSY_TIMEOUT}} if self.is_sqlite else {"pool_pre_ping": True}
            self.optuna = RDBStorage(self.url, engine_kwargs=options)
        self._engine: sa.Engine = self.optuna.engine
        self._statements: dict[Any, Any] = {}
        if self.is_sqlite:
            sa.event.listen(self._engine, "connect", _use_wal)
            self._engine.dispose()  # so that the connection that checked the schema is opened again, with the pragmas

    def close(self) -> None:
        self._engine.dispose()

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except (SQLAlchemyError, RuntimeError, ImportError, sqlite3.Error) as problem:
            cause = getattr(problem, "orig", None) or problem
            raise StorageError(f"{self.url}: {' '.join(str(cause).split())[:300]}") from None

    def names(self) -> list[str]:
        """Names of the studies that metaid made, oldest first."""
        query = (
            sa.select(models.StudyModel.study_name)
            .join(models.StudyUserAttributeModel)
            .where(models.StudyUserAttributeModel.key == SPEC_KEY)
            .order_by(models.StudyModel.study_id)
        )
        with self._errors(), self._engine.connect() as connection:
            return list(connection.scalars(query))

    def create(self, name: str, spec: str) -> None:
        """A study of that `name` without trials, made from `spec` (JSON), in one transaction.  Raises StorageError if
        there is one.
        """
        with self._errors(), self._engine.begin() as connection:
            if (
                connection.scalar(sa.select(models.StudyModel.study_id).where(models.StudyModel.study_name == name))
                is not None
            ):
                raise StorageError(
                    f"{self.url} has a study '{name}' already (choose another with --name, or delete it)"
                )
            study_id = connection.scalar(
                sa.insert(models.StudyModel).values(study_name=name).returning(models.StudyModel.study_id)
            )
            connection.execute(
                sa.insert(models.StudyDirectionModel).values(
                    direction=StudyDirection.MINIMIZE, study_id=study_id, objective=0
                )
            )
            attribute = {"study_id": study_id, "key": SPEC_KEY, "value_json": json.dumps(json.loads(spec))}
            connection.execute(sa.insert(models.StudyUserAttributeModel).values(**attribute))

    def spec(self, name: str) -> str:
        """The JSON that the study was made from."""
        query = sa.select(models.StudyUserAttributeModel.value_json).where(
            models.StudyUserAttributeModel.study_id == self._study_id(name),
            models.StudyUserAttributeModel.key == SPEC_KEY,
        )
        with self._errors(), self._engine.connect() as connection:
            return str(connection.scalar(query))

    def delete(self, name: str) -> None:
        """Deletes a study and its trials."""
        study_id = self._study_id(name)
        trials = sa.select(models.TrialModel.trial_id).where(models.TrialModel.study_id == study_id)
        with self._errors(), self._engine.begin() as connection:
            for model in _TRIAL_TABLES:
                connection.execute(sa.delete(model).where(model.trial_id.in_(trials)))
            for model in (
                models.TrialModel,
                models.StudyUserAttributeModel,
                models.StudySystemAttributeModel,
                models.StudyDirectionModel,
            ):
                connection.execute(sa.delete(model).where(model.study_id == study_id))
            connection.execute(sa.delete(models.StudyModel).where(models.StudyModel.study_id == study_id))

    def append(self, name: str, names: Sequence[str], low: Array, high: Array, trials: Sequence[Trial]) -> None:
        """Adds finished `trials` in one transaction; factors are stored under the lumps' `names` with their bounds
        (nlump).

        Raises StorageError, and writes nothing, if they would not follow the last trial: somebody else is running the
        study.
        """
        distributions = [
            distribution_to_json(FloatDistribution(a, b)) for a, b in zip(low.tolist(), high.tolist(), strict=True)
        ]
        with self._errors(), self._engine.begin() as connection:
            if self.is_sqlite:
                connection.exec_driver_sql("BEGIN IMMEDIATE")  # takes the write lock before the last number is read
            study_id, last_id, count = _end_of(connection, name)
            if count != trials[0].number:
                raise StorageError(
                    f"study '{name}' has {count} trials where {trials[0].number} were expected: "
                    "it is being run elsewhere"
                )
            self._insert(connection, models.TrialModel, _heads(study_id, trials))
            ids = list(connection.scalars(_IDS_AFTER, {"study_id": study_id, "last_id": last_id}))
            for model, rows in _rows(ids, trials, names, distributions).items():
                self._insert(connection, model, rows)

    def count(self, name: str) -> int:
        """How many trials a study has."""
        with self._errors(), self._engine.connect() as connection:
            return _end_of(connection, name)[2]

    def _insert(self, connection: sa.Connection, model: Any, rows: list[dict[str, Any]]) -> None:
        """Inserts `rows`, all with the same columns and of types that the driver knows.

        SQLAlchemy makes the statement once; preparing each row anew, as it would, takes longer than writing it.
        """
        if model not in self._statements:
            self._statements[model] = sa.insert(model).compile(self._engine, column_keys=list(rows[0]))
        statement = self._statements[model]
        if statement.positiontup is None:
            connection.exec_driver_sql(statement.string, rows)
        else:
            order = operator.itemgetter(*statement.positiontup)
            connection.exec_driver_sql(statement.string, [order(row) for row in rows])

    def trials(self, name: str, names: Sequence[str]) -> list[Trial]:
        """All trials in order, with their factors in the order of `names`."""
        study_id = self._study_id(name)
        trial, parameter, attribute = models.TrialModel, models.TrialParamModel, models.TrialUserAttributeModel
        joints = range(1, 1 + sum(lump.startswith("gravity_") for lump in names))
        keys = ["generation", "steps", *(f"periods_{joint}" for joint in joints)]
        with self._snapshot() as connection:
            columns = trial.number, trial.state, trial._datetime_start_utc, trial._datetime_complete_utc
            query = sa.select(*columns).where(trial.study_id == study_id).order_by(trial.trial_id)
            heads = connection.execute(query).all()
            value = models.TrialValueModel
            try:
                values = _table(connection, study_id, value.objective, value.value, [0], float)
                factors = _table(connection, study_id, parameter.param_name, parameter.param_value, names, float)
                counts = _table(connection, study_id, attribute.key, attribute.value_json, keys, int)
                whole = len(values) == len(factors) == len(counts) == len(heads) and np.isfinite(factors).all()
            except (ValueError, TypeError):
                whole = False
        if not whole:
            raise StorageError(f"{self.url}: study '{name}' has trials that metaid did not write")
        return [
            Trial(
                number=head[0],
                generation=count[0],
                factors=row,
                outcome=Outcome(value, head[1] == TrialState.PRUNED, count[1], tuple(count[2:])),
                started=head[2],
                completed=head[3],
            )
            for head, value, row, count in zip(heads, values[:, 0].tolist(), factors, counts.tolist(), strict=True)
        ]

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
            study_id = connection.scalar(
                sa.select(models.StudyModel.study_id).where(models.StudyModel.study_name == name)
            )
        if study_id is None or name not in self.names():
            raise StorageError(f"{self.url}: {unknown('study', name, self.names())}")
        return int(study_id)


_TRIAL_TABLES = (
    models.TrialParamModel,
    models.TrialValueModel,
    models.TrialIntermediateValueModel,
    models.TrialUserAttributeModel,
    models.TrialSystemAttributeModel,
    models.TrialHeartbeatModel,
)


# Made once: making a statement takes longer than running it.
_END = (
    sa.select(models.StudyModel.study_id, models.TrialModel.trial_id, models.TrialModel.number)
    .outerjoin(models.TrialModel)
    .where(models.StudyModel.study_name == sa.bindparam("study"))
    .order_by(models.TrialModel.trial_id.desc())
    .limit(1)
)
_IDS_AFTER = (
    sa.select(models.TrialModel.trial_id)
    .where(models.TrialModel.study_id == sa.bindparam("study_id"), models.TrialModel.trial_id > sa.bindparam("last_id"))
    .order_by(models.TrialModel.number)
)


def _end_of(connection: sa.Connection, name: str) -> tuple[int, int, int]:
    """A study's id, the id of its last trial, how many it has; looked up from the end, so as fast in a large table."""
    end = connection.execute(_END, {"study": name}).first()
    if end is None:
        raise StorageError(f"study '{name}' is no longer there")
    study_id, last_id, number = end
    return (study_id, 0, 0) if last_id is None else (study_id, last_id, number + 1)


def _table(
    connection: sa.Connection, study_id: int, key: Any, value: Any, keys: Sequence[Any], kind: type
) -> NDArray[Any]:
    """The values under `keys` of every trial, in order (ntrial x nkey); of no trial if one lacks any of them.

    A trial has a key at most once and the DB's own order of keys is the same for all, so nothing but values is read.
    Raises ValueError or TypeError for one that is not of that `kind`.
    """
    where = models.TrialModel.study_id == study_id, key.in_(keys)
    query = sa.select(value).join(models.TrialModel).where(*where).order_by(models.TrialModel.trial_id, key)
    order = list(connection.scalars(query.with_only_columns(key).limit(len(keys))))
    # The driver's own rows: SQLAlchemy's would cost three times the reading.
    cursor = connection.connection.cursor()
    cursor.execute(str(query.compile(connection.engine, compile_kwargs={"literal_binds": True})))
    cells: NDArray[Any] = np.fromiter((kind(cell) for (cell,) in iter(cursor.fetchone, None)), kind)
    cursor.close()
    if len(cells) % len(keys) or sorted(order) != sorted(keys):
        return np.empty((0, len(keys)), kind)
    return cells.reshape(-1, len(keys))[:, [order.index(wanted) for wanted in keys]]


def _heads(study_id: int, trials: Sequence[Trial]) -> list[dict[str, Any]]:
    return [
        {
            "number": trial.number,
            "study_id": study_id,
            "state": (TrialState.PRUNED if trial.outcome.fell else TrialState.COMPLETE).name,
            "datetime_start": trial.started and str(trial.started),
            "datetime_complete": trial.completed and str(trial.completed),
        }
        for trial in trials
    ]


def _rows(
    ids: Sequence[int], trials: Sequence[Trial], names: Sequence[str], distributions: Sequence[str]
) -> dict[Any, list[dict[str, Any]]]:
    """Rows by model class. A fall carries its value as intermediate value at the step that it survived to, as
    Optuna's own `tell` would write it.
    """
    finite_value = models.TrialValueModel.TrialValueType.FINITE.name
    finite_step = models.TrialIntermediateValueModel.TrialIntermediateValueType.FINITE.name
    rows: dict[Any, list[dict[str, Any]]] = {
        models.TrialParamModel: [
            {"trial_id": i, "param_name": name, "param_value": value, "distribution_json": distribution}
            for i, trial in zip(ids, trials, strict=True)
            for name, value, distribution in zip(names, trial.factors.tolist(), distributions, strict=True)
        ],
        models.TrialValueModel: [
            {"trial_id": i, "objective": 0, "value": trial.outcome.value, "value_type": finite_value}
            for i, trial in zip(ids, trials, strict=True)
        ],
        models.TrialIntermediateValueModel: [
            {
                "trial_id": i,
                "step": trial.outcome.steps,
                "intermediate_value": trial.outcome.value,
                "intermediate_value_type": finite_step,
            }
            for i, trial in zip(ids, trials, strict=True)
        ],
        models.TrialUserAttributeModel: [
            {"trial_id": i, "key": key, "value_json": str(value)}
            for i, trial in zip(ids, trials, strict=True)
            for key, value in _attributes(trial).items()
        ],
    }
    return rows


def _attributes(trial: Trial) -> dict[str, int]:
    periods = {f"periods_{joint + 1}": count for joint, count in enumerate(trial.outcome.periods)}
    return {"generation": trial.generation, "steps": trial.outcome.steps, **periods}


def _check_sqlite_file(path: Path, create: bool) -> None:
    if not path.exists():
        if not create:
            raise StorageError(
                f"no study DB at {path}: make a study with 'metaid study create', or name another with --storage"
            )
        if not path.parent.is_dir():
            raise StorageError(f"{path}: no such folder {path.parent}")
        return
    if not path.is_file():
        raise StorageError(f"{path}: not a file, so not a study DB")
    try:
        connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
        try:
            tables = {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        finally:
            connection.close()
    except sqlite3.Error as problem:
        raise StorageError(f"{path}: not a study DB: {problem}") from None
    if tables and not {"studies", "trials", "version_info"} <= tables:
        raise StorageError(f"{path}: an SQLite file, but not a study DB")
    if not tables and not create:
        raise StorageError(f"{path}: an empty file, not a study DB")


def _use_wal(connection: Any, _record: Any) -> None:
    cursor = connection.cursor()
    cursor.execute("PRAGMA journal_mode=WAL")
    cursor.execute("PRAGMA synchronous=NORMAL")
    cursor.close()
