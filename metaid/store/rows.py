"""The rows that a trial is written as in the tables of an Optuna study DB, and the columns that are read back.

Statements and rows only; connections and transactions are those of `Store`.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sqlalchemy as sa
from numpy.typing import NDArray
from optuna.trial import FrozenTrial, TrialState

from metaid.episode import FALL_VALUE, Outcome
from metaid.store.motion import MOTIONS
from metaid.store.optuna_tables import (
    FINITE_INTERMEDIATE_VALUE,
    FINITE_VALUE,
    NO_INTERMEDIATE_VALUE,
    TRIAL_ATTRIBUTES,
    TRIAL_INTERMEDIATE_VALUES,
    TRIAL_PARAMS,
    TRIAL_VALUES,
    TRIALS,
)
from metaid.store.ownership import MARK, End, mark_of
from metaid.store.trial import Trial

SPOILED = ValueError, TypeError, LookupError, ArithmeticError  # what reading a row of another type or form raises
REASON = "reason"  # the attribute that says why a trial failed
MOTION_KEYS = tuple(MOTIONS)  # those that an estimate is made of

# Made once: making a statement takes longer than running it.
IDS_AFTER = (
    sa.select(TRIALS.c.trial_id)
    .where(TRIALS.c.study_id == sa.bindparam("study_id"), TRIALS.c.trial_id > sa.bindparam("last_id"))
    .order_by(TRIALS.c.number)
)


@dataclass(frozen=True)
class Own:
    """The trials of the study `study_id` that metaid wrote, read over a `connection`: their `positions` by their id in
    the DB. `alone`: whether the study has no others.
    """

    connection: sa.Connection
    study_id: int
    positions: dict[int, int]
    alone: bool

    def table(self, key: Any, value: Any, keys: Sequence[Any], kind: type) -> NDArray[Any]:
        """The values under some keys of every trial, in order (ntrial x nkey); of no trial if one lacks any of them.

        A trial has a key at most once, in an order that is the DB's own for all: so nothing but values is read, unless
        there are trials of others in between.

        Args:
            key: the column of the keys.
            value: the column of the values.
            keys: that are read (nkey).
            kind: of the values: int or float.

        Raises:
            ValueError: a value is of another kind.
            TypeError: a value is of another kind.
        """
        where = TRIALS.c.study_id == self.study_id, key.in_(keys)
        query = sa.select(value).select_from(value.table.join(TRIALS)).where(*where).order_by(TRIALS.c.trial_id, key)
        if self.alone:
            order = list(self.connection.scalars(query.with_only_columns(key).limit(len(keys))))
        else:
            query = query.with_only_columns(value, key, TRIALS.c.trial_id)
        # The driver's own rows: SQLAlchemy's would cost three times the reading.
        cursor = self.connection.connection.cursor()
        cursor.execute(str(query.compile(self.connection.engine, compile_kwargs={"literal_binds": True})))
        rows = iter(cursor.fetchone, None)
        if not self.alone:
            kept = [row for row in rows if row[2] in self.positions]
            order, rows = [row[1] for row in kept[: len(keys)]], iter(kept)
        cells: NDArray[Any] = np.fromiter((kind(row[0]) for row in rows), kind)
        cursor.close()
        if len(cells) % len(keys) or sorted(order) != sorted(keys):
            return np.empty((0, len(keys)), kind)
        return cells.reshape(-1, len(keys))[:, [order.index(wanted) for wanted in keys]]

    def outcomes(self, states: Sequence[TrialState], joint_count: int) -> list[tuple[int, Outcome]]:
        """The generation and the outcome of every trial, of these `states` (ntrial), in order; of none if one lacks
        something.  Raises ValueError or TypeError where a value is not a number.
        """
        value, attribute = TRIAL_VALUES.c, TRIAL_ATTRIBUTES.c
        keys = ["generation", "steps", *(f"periods_{joint + 1}" for joint in range(joint_count))]
        counts = self.table(attribute.key, attribute.value_json, keys, int)
        values = self.table(value.objective, value.value, [0], float)
        ranked = {place: float(json.loads(text)) for place, text in self._attributes(FALL_VALUE)}
        reasons = {place: str(json.loads(text)) for place, text in self._attributes(REASON)}
        survived = [i for i, state in enumerate(states) if state == TrialState.COMPLETE]
        failed = {i for i, state in enumerate(states) if state == TrialState.FAIL}
        if not (len(counts) == len(states) == len(values) + len(ranked) and reasons.keys() == failed):
            return []
        ranked |= dict(zip(survived, values[:, 0].tolist(), strict=True))
        return [
            (generation, Outcome(ranked[i], state != TrialState.COMPLETE, steps, tuple(periods), reasons.get(i)))
            for i, (state, (generation, steps, *periods)) in enumerate(zip(states, counts.tolist(), strict=True))
        ]

    def motions(self) -> dict[int, dict[str, Any]]:
        """The motion of those that have any, by position: the fields of an outcome that hold it.  Raises ValueError,
        TypeError or LookupError for what is none.
        """
        found: dict[int, dict[str, Any]] = {}
        for key, (_, read) in MOTIONS.items():
            for position, text in self._attributes(key):
                found.setdefault(position, {})[key] = read(text)
        return found

    def _attributes(self, key: str) -> list[tuple[int, str]]:
        """Those that have an attribute of this `key`, by position, and its JSON."""
        query = (
            sa.select(TRIAL_ATTRIBUTES.c.trial_id, TRIAL_ATTRIBUTES.c.value_json)
            .join(TRIALS)
            .where(TRIALS.c.study_id == self.study_id, TRIAL_ATTRIBUTES.c.key == key)
        )
        rows = self.connection.execute(query)
        return [(self.positions[one], str(text)) for one, text in rows if one in self.positions]


def head_rows(end: End, trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """Rows of trials that come after the `end` of their study; Optuna counts the trials of others, too."""
    return [
        {
            "number": end.next_number + i,
            "study_id": end.study_id,
            "state": trial.state.name,
            "datetime_start": trial.started and str(trial.started),
            "datetime_complete": trial.completed and str(trial.completed),
        }
        for i, trial in enumerate(trials)
    ]


def detail_rows(
    ids: Sequence[int], trials: Sequence[Trial], names: Sequence[str], distributions: Sequence[str], digest: str
) -> dict[sa.Table, list[dict[str, Any]]]:
    """Rows by table.

    A fall has no value and, at the step that it survived to, NaN as intermediate value: its frequency is not known, and
    what Optuna's tools draw of the others is not to be drowned by what it is ranked by.

    Args:
        ids: of the trials in the DB (ntrial).
        trials: that are written (ntrial).
        names: under which the factors are stored (nsearched).
        distributions: of the factors, as Optuna's JSON (nsearched).
        digest: of the study.
    """
    rows: dict[sa.Table, list[dict[str, Any]]] = defaultdict(list)
    for i, trial in zip(ids, trials, strict=True):
        fell, value = trial.outcome.fell, trial.outcome.value
        if not fell:
            measured = {"objective": 0, "value": value, "value_type": FINITE_VALUE}
            rows[TRIAL_VALUES].append({"trial_id": i, **measured})
        if trial.state != TrialState.FAIL:
            rows[TRIAL_INTERMEDIATE_VALUES].append({
                "trial_id": i,
                "step": trial.outcome.steps,
                "intermediate_value": None if fell else value,
                "intermediate_value_type": NO_INTERMEDIATE_VALUE if fell else FINITE_INTERMEDIATE_VALUE,
            })  # fmt: skip
        rows[TRIAL_PARAMS] += [
            {"trial_id": i, "param_name": name, "param_value": factor, "distribution_json": distribution}
            for name, factor, distribution in zip(names, trial.factors.tolist(), distributions, strict=True)
        ]
        rows[TRIAL_ATTRIBUTES] += [
            {"trial_id": i, "key": key, "value_json": text}
            for key, text in {MARK: mark_of(digest, trial.number), **_attributes(trial)}.items()
        ]
    return {table: of_table for table, of_table in rows.items() if of_table}


def _attributes(trial: Trial) -> dict[str, str]:
    """JSON by key."""
    reason = {} if trial.outcome.failure is None else {REASON: trial.outcome.failure}
    texts = {key: json.dumps(value) for key, value in {"generation": trial.generation, **reason}.items()}
    return {**texts, **outcome_attributes(trial.outcome)}


def outcome_attributes(outcome: Outcome) -> dict[str, str]:
    """What a trial says of its `outcome` beside its value, as JSON by key: steps, periods, and the motion if kept."""
    periods = {f"periods_{joint + 1}": count for joint, count in enumerate(outcome.periods)}
    ranked = {FALL_VALUE: outcome.value} if outcome.fell else {}
    texts = {key: json.dumps(value) for key, value in {"steps": outcome.steps, **periods, **ranked}.items()}
    moved = {key: getattr(outcome, key) for key in MOTIONS}
    texts |= {key: MOTIONS[key][0](motion) for key, motion in moved.items() if motion is not None}
    return texts


def shown_trial(frozen: FrozenTrial, names: Sequence[str]) -> Trial | None:
    """A trial that `metaid.objective` evaluated, with its factors in the order of `names` and the motion that it
    carries; None where it carries none, is not finished, or is not as the objective leaves it.
    """
    if frozen.state not in (TrialState.COMPLETE, TrialState.PRUNED):
        return None
    texts = {key: json.dumps(value) for key, value in frozen.user_attrs.items() if key in MOTION_KEYS}
    try:
        motion = {key: MOTIONS[key][1](text) for key, text in texts.items()}
        outcome = Outcome(
            float(frozen.user_attrs.get(FALL_VALUE, 0.0) if frozen.value is None else frozen.value),
            frozen.state != TrialState.COMPLETE,
            int(frozen.user_attrs["steps"]),
            (),
            **motion,
        )
        factors = np.array([float(frozen.params[name]) for name in names])
    except SPOILED:
        return None
    return Trial(frozen.number, 0, factors, outcome) if texts and np.isfinite(factors).all() else None
