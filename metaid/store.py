"""The study DB: an ordinary Optuna study DB, written a generation at a time.

Optuna's storage opens the DB, makes its tables and checks its schema version; rows are written through Optuna's own
SQLAlchemy model classes, one transaction per generation, so that a reader or a crash sees whole generations and never
a RUNNING trial. Nothing in a DB is ever unpickled.
"""

from __future__ import annotations

import json
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
        study_id = self._study_id(name)
        distributions = [
            distribution_to_json(FloatDistribution(a, b)) for a, b in zip(low.tolist(), high.tolist(), strict=True)
        ]
        with self._errors(), self._engine.begin() as connection:
            if self.is_sqlite:
                connection.exec_driver_sql("BEGIN IMMEDIATE")  # takes the write lock before the count is read
            count = connection.scalar(sa.select(sa.func.count()).where(models.TrialModel.study_id == study_id))
            if count != trials[0].number:
                raise StorageError(
                    f"study '{name}' has {count} trials where {trials[0].number} were expected: "
                    "it is being run elsewhere"
                )
            rows = [
                {
                    "number": trial.number,
                    "study_id": study_id,
                    "state": TrialState.PRUNED if trial.outcome.fell else TrialState.COMPLETE,
                    "datetime_start": trial.started,
                    "datetime_complete": trial.completed,
                }
                for trial in trials
            ]
            insert = sa.insert(models.TrialModel).returning(models.TrialModel.trial_id, sort_by_parameter_order=True)
            ids = list(connection.scalars(insert, rows))
            for model, rows in _rows(ids, trials, names, distributions).items():
                connection.execute(sa.insert(model), rows)

    def trials(self, name: str, names: Sequence[str]) -> list[Trial]:
        """All trials in order, with their factors in the order of `names`."""
        study_id = self._study_id(name)
        with self._snapshot() as connection:
            columns = (models.TrialModel.trial_id, models.TrialModel.number, models.TrialModel.state)
            times = (models.TrialModel._datetime_start_utc, models.TrialModel._datetime_complete_utc)
            heads = connection.execute(
                sa.select(*columns, *times)
                .where(models.TrialModel.study_id == study_id)
                .order_by(models.TrialModel.number)
            ).all()

            def per_trial(model: Any, *wanted: Any) -> Any:
                return connection.execute(
                    sa.select(model.trial_id, *wanted)
                    .join(models.TrialModel)
                    .where(models.TrialModel.study_id == study_id)
                )

            row = {head.trial_id: i for i, head in enumerate(heads)}
            column = {lump: i for i, lump in enumerate(names)}
            factors = np.full((len(heads), len(names)), np.nan)
            for trial_id, lump, value in per_trial(
                models.TrialParamModel, models.TrialParamModel.param_name, models.TrialParamModel.param_value
            ):
                if lump in column:
                    factors[row[trial_id], column[lump]] = value
            values = dict(per_trial(models.TrialValueModel, models.TrialValueModel.value).all())
            attributes: list[dict[str, Any]] = [{} for _ in heads]
            attribute = models.TrialUserAttributeModel
            for trial_id, key, value in per_trial(attribute, attribute.key, attribute.value_json):
                attributes[row[trial_id]][key] = json.loads(value)
        if not np.isfinite(factors).all() or len(values) != len(heads):
            raise StorageError(f"{self.url}: study '{name}' has trials that metaid did not write")
        return [
            Trial(
                number=head.number,
                generation=attributes[i]["generation"],
                factors=factors[i],
                outcome=Outcome(
                    values[head.trial_id],
                    head.state == TrialState.PRUNED,
                    attributes[i]["steps"],
                    _periods(attributes[i]),
                ),
                started=head[3],
                completed=head[4],
            )
            for i, head in enumerate(heads)
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


def _rows(
    ids: Sequence[int], trials: Sequence[Trial], names: Sequence[str], distributions: Sequence[str]
) -> dict[Any, list[dict[str, Any]]]:
    """Rows by model class. A fall carries its value as intermediate value at the step that it survived to, as
    Optuna's own `tell` would write it.
    """
    finite_value = models.TrialValueModel.TrialValueType.FINITE
    finite_step = models.TrialIntermediateValueModel.TrialIntermediateValueType.FINITE
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


def _periods(attributes: dict[str, Any]) -> tuple[int, ...]:
    return tuple(
        attributes[f"periods_{joint}"] for joint in range(1, sum(key.startswith("periods_") for key in attributes) + 1)
    )


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
