"""The trials of a study, read back from the tables of its DB."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sqlalchemy as sa

from metaid.store.optuna_tables import STUDY_ATTRIBUTES, TRIAL_ATTRIBUTES, TRIAL_PARAMS, TRIAL_VALUES, TRIALS
from metaid.store.ownership import DIGEST, EXPERIMENT, MARK, own_rows
from metaid.store.rows import MOTION_KEYS, Own
from metaid.store.trial import ForeignTrial, Trial

JOINTS_KEY = "metaid:joints"  # of a study: how many joints its plant has
MOST_JOINTS = 10_000  # of any plant: a DB that claims more was not written by metaid


@dataclass(frozen=True)
class StoredTrials:
    """The trials of a study: metaid's `own` in order, and those of others; the ids in the DB of those of others that
    carry motion, by Optuna's number.
    """

    own: list[Trial]
    foreign: tuple[ForeignTrial, ...]
    with_motion: dict[int, int]


def read_trials(connection: sa.Connection, study_id: int, names: Sequence[str]) -> StoredTrials:
    """All trials, with their factors in the order of `names`.

    Raises ValueError, TypeError or LookupError where metaid's own are not as it writes them.
    """
    trial, mark = TRIALS.c, TRIAL_ATTRIBUTES.c
    # Times are naive UTC here, and in local time in what Optuna makes of them.
    columns = trial.trial_id, trial.number, trial.state, trial.datetime_start, trial.datetime_complete
    query = (
        sa.select(*columns, mark.value_json)
        .outerjoin(TRIAL_ATTRIBUTES, (mark.trial_id == trial.trial_id) & (mark.key == MARK))
        .where(trial.study_id == study_id)
        .order_by(trial.trial_id)
    )
    rows = connection.execute(query).all()
    digest, joint_count = _made_from(connection, study_id)
    is_own = own_rows(digest, [row[5] for row in rows])
    heads = [row for row, own in zip(rows, is_own, strict=True) if own]
    others = [row for row, own in zip(rows, is_own, strict=True) if not own]
    trials = Own(connection, study_id, {row[0]: i for i, row in enumerate(heads)}, alone=not others)
    own_trials = _own_trials(trials, heads, names, joint_count)
    experiments, values, with_motion = _evaluated(connection, study_id) if others else ({}, {}, set[int]())
    foreign = tuple(
        ForeignTrial(int(row[1]), row[2].name, experiments.get(row[0]), values.get(row[0])) for row in others
    )
    return StoredTrials(own_trials, foreign, {int(row[1]): row[0] for row in others if row[0] in with_motion})


def _evaluated(connection: sa.Connection, study_id: int) -> tuple[dict[int, str], dict[int, float], set[int]]:
    """Of the trials that `metaid.objective` evaluated, by their id in the DB: the experiment that they are of, the
    value, and which of them carry motion.
    """
    marked, value, moved = TRIAL_ATTRIBUTES, TRIAL_VALUES, TRIAL_ATTRIBUTES.alias()
    trials, where = marked.join(TRIALS), (TRIALS.c.study_id == study_id, marked.c.key == EXPERIMENT)
    texts = sa.select(marked.c.trial_id, marked.c.value_json).select_from(trials)
    numbers = sa.select(marked.c.trial_id, value.c.value).select_from(trials.join(value))
    motions = sa.select(marked.c.trial_id).select_from(trials.join(moved)).where(moved.c.key.in_(MOTION_KEYS))
    experiments = {row[0]: str(row[1]).strip('"') for row in connection.execute(texts.where(*where))}
    values = {row[0]: row[1] for row in connection.execute(numbers.where(*where)) if isinstance(row[1], float)}
    return experiments, values, set(connection.scalars(motions.where(*where)))


def _made_from(connection: sa.Connection, study_id: int) -> tuple[str, int]:
    """The digest of a study's settings; and how many joints its plant has, and so how many counts of periods each
    trial.  Raises ValueError or LookupError where the study does not say so.
    """
    attribute = STUDY_ATTRIBUTES.c
    where = attribute.study_id == study_id, attribute.key.in_((DIGEST, JOINTS_KEY))
    rows = connection.execute(sa.select(attribute.key, attribute.value_json).where(*where))
    texts = {key: str(text) for key, text in rows}
    joint_count = int(texts[JOINTS_KEY])
    if not 1 <= joint_count <= MOST_JOINTS:
        raise ValueError("not a number of joints")
    return json.loads(texts[DIGEST]), joint_count


def _own_trials(trials: Own, heads: Sequence[Any], names: Sequence[str], joint_count: int) -> list[Trial]:
    """The trials with these `heads`: id, Optuna's number, state, begin and end; so many counts of periods each."""
    states = [head[2] for head in heads]
    key, value = TRIAL_PARAMS.c.param_name, TRIAL_PARAMS.c.param_value
    factors = trials.table(key, value, names, float)
    outcomes = trials.outcomes(states, joint_count)
    motions = trials.motions()
    whole = (
        len(factors) == len(outcomes) == len(heads)
        and all(state.is_finished() for state in states)
        and bool(np.isfinite(factors).all())
        and bool(np.isfinite([outcome.value for _, outcome in outcomes]).all())
    )
    if not whole:
        raise ValueError("trials that lack something")
    return [
        Trial(
            number=i,
            generation=generation,
            factors=row,
            outcome=replace(outcome, **motions.get(i, {})),
            started=head[3],
            completed=head[4],
        )
        for i, (head, row, (generation, outcome)) in enumerate(zip(heads, factors, outcomes, strict=True))
    ]
