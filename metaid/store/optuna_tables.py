"""The tables of an Optuna study DB, as Optuna's own SQLAlchemy classes.

Optuna's public storage writes a trial in some ten transactions; a generation in one needs its tables. They are private
names of Optuna, so all of them stand here, and pyproject.toml caps Optuna's version.
"""

import sys

from optuna.storages._rdb.models import (
    SCHEMA_VERSION,
    StudyDirectionModel,
    StudyModel,
    StudySystemAttributeModel,
    StudyUserAttributeModel,
    TrialHeartbeatModel,
    TrialIntermediateValueModel,
    TrialModel,
    TrialParamModel,
    TrialSystemAttributeModel,
    TrialUserAttributeModel,
    TrialValueModel,
)

REVISION = "v3.2.0.a"  # of the tables of this schema; Optuna itself takes a tenth of a second to say so

# The types of values as the tables name them: a number that is neither NaN nor infinite, and one that is NaN.
FINITE_VALUE = TrialValueModel.TrialValueType.FINITE.name
FINITE_INTERMEDIATE_VALUE = TrialIntermediateValueModel.TrialIntermediateValueType.FINITE.name
NO_INTERMEDIATE_VALUE = TrialIntermediateValueModel.TrialIntermediateValueType.NAN.name

# Naive UTC, of the columns and not of Optuna's properties, which are in local time.
STARTED = TrialModel.__table__.c.datetime_start
COMPLETED = TrialModel.__table__.c.datetime_complete

__all__ = [
    "COMPLETED",
    "FINITE_INTERMEDIATE_VALUE",
    "FINITE_VALUE",
    "NO_INTERMEDIATE_VALUE",
    "REVISION",
    "SCHEMA_VERSION",
    "STARTED",
    "StudyDirectionModel",
    "StudyModel",
    "StudySystemAttributeModel",
    "StudyUserAttributeModel",
    "TrialHeartbeatModel",
    "TrialIntermediateValueModel",
    "TrialModel",
    "TrialParamModel",
    "TrialSystemAttributeModel",
    "TrialUserAttributeModel",
    "TrialValueModel",
    "unreadable",
]


def unreadable() -> tuple[type[Exception], ...]:
    """What Optuna's storage raises for tables that it cannot read: an error of alembic's, which takes a tenth of a
    second to load, and is loaded by then.
    """
    loaded = sys.modules.get("alembic.util.exc")
    return () if loaded is None else (loaded.CommandError,)
