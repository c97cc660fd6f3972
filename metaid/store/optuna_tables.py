"""The tables of an Optuna study DB, which are those of Optuna's own SQLAlchemy classes.

Optuna's public storage writes a trial in some ten transactions; a generation in one needs its tables. They are private
names of Optuna, so all of them stand here, and pyproject.toml caps Optuna's version.
"""

# ruff: noqa: F401, what is imported here is what the package uses of them

import sys
from typing import Any

import sqlalchemy as sa
from optuna.storages._rdb.models import (
    SCHEMA_VERSION,
    StudyDirectionModel,
    StudyModel,
    StudySystemAttributeModel,
    StudyUserAttributeModel,
    TrialIntermediateValueModel,
    TrialModel,
    TrialParamModel,
    TrialUserAttributeModel,
    TrialValueModel,
)

REVISION = "v3.2.0.a"  # of the tables of this schema; Optuna itself takes a tenth of a second to say so

# The types of values as the tables name them: a number that is neither NaN nor infinite, and one that is NaN.
FINITE_VALUE = TrialValueModel.TrialValueType.FINITE.name
FINITE_INTERMEDIATE_VALUE = TrialIntermediateValueModel.TrialIntermediateValueType.FINITE.name
NO_INTERMEDIATE_VALUE = TrialIntermediateValueModel.TrialIntermediateValueType.NAN.name


def _table(model: Any) -> sa.Table:
    table: sa.Table = model.__table__
    return table


STUDIES, STUDY_DIRECTIONS = _table(StudyModel), _table(StudyDirectionModel)
STUDY_ATTRIBUTES, STUDY_SYSTEM_ATTRIBUTES = _table(StudyUserAttributeModel), _table(StudySystemAttributeModel)
TRIALS, TRIAL_ATTRIBUTES, TRIAL_PARAMS = _table(TrialModel), _table(TrialUserAttributeModel), _table(TrialParamModel)
TRIAL_VALUES, TRIAL_INTERMEDIATE_VALUES = _table(TrialValueModel), _table(TrialIntermediateValueModel)


def _tables_of(own: sa.Table) -> tuple[sa.Table, ...]:
    """Those whose rows each belong to a row of a table."""
    return tuple(each for each in own.metadata.sorted_tables if any(key.references(own) for key in each.foreign_keys))


STUDY_TABLES, TRIAL_TABLES = _tables_of(STUDIES), _tables_of(TRIALS)


def unreadable() -> tuple[type[Exception], ...]:
    """What Optuna's storage raises for tables that it cannot read: an error of alembic's, which takes a tenth of a
    second to load, and is loaded by then.
    """
    loaded = sys.modules.get("alembic.util.exc")
    return () if loaded is None else (loaded.CommandError,)
