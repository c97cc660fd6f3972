"""The trials of a study, read back from the tables of its DB."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import sqlalchemy as sa

from metaid.store.optuna_tables import (
    COMPLETED,
    STARTED,
    StudyUserAttributeModel,
    TrialModel,
    TrialParamModel,
)
from metaid.store.rows import read_outcomes, read_readings, read_table, read_windows
from metaid.store.trial import Trial

JOINTS_KEY = "metaid:joints"  # of a study: how many joints its plant has
MOST_JOINTS = 10_000  # of any plant: a DB that claims more was not written by metaid


def read_trials(connection: sa.Connection, study_id: int, names: Sequence[Sequence[str]]) -> list[Trial]:
    """All trials in order, with their factors in the order of their stage's `names`.

    Raises ValueError, TypeError or LookupError where they are not as metaid writes them.
    """
    query = sa.select(TrialModel.number, TrialModel.state, STARTED, COMPLETED)
    heads = connection.execute(query.where(TrialModel.study_id == study_id).order_by(TrialModel.trial_id)).all()
    states = [head[1] for head in heads]
    key, value = TrialParamModel.param_name, TrialParamModel.param_value
    tables = [read_table(connection, study_id, key, value, searched, float) for searched in names]
    factors = list(itertools.chain(*tables))
    outcomes = read_outcomes(connection, study_id, states, _joint_count(connection, study_id))
    windows, readings = read_windows(connection, study_id), read_readings(connection, study_id)
    whole = (
        len(factors) == len(outcomes) == len(heads)
        and [head[0] for head in heads] == list(range(len(heads)))
        and all(state.is_finished() for state in states)
        and all(np.isfinite(table).all() for table in tables)
        and bool(np.isfinite([outcome.value for _, outcome in outcomes]).all())
    )
    if not whole:
        raise ValueError("trials that lack something")
    stages = [None] * len(heads) if len(names) == 1 else [i + 1 for i, table in enumerate(tables) for _ in table]
    return [
        Trial(
            number=head[0],
            generation=generation,
            factors=row,
            outcome=replace(outcome, windows=windows.get(head[0]), readings=readings.get(head[0])),
            started=head[2],
            completed=head[3],
            stage=stage,
        )
        for head, row, (generation, outcome), stage in zip(heads, factors, outcomes, stages, strict=True)
    ]


def _joint_count(connection: sa.Connection, study_id: int) -> int:
    """How many joints the study's plant has, and so how many counts of periods each trial.  Raises ValueError."""
    attribute = StudyUserAttributeModel
    where = attribute.study_id == study_id, attribute.key == JOINTS_KEY
    stored = int(connection.scalar(sa.select(attribute.value_json).where(*where)) or 0)
    if not 1 <= stored <= MOST_JOINTS:
        raise ValueError("not a number of joints")
    return stored
