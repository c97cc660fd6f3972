"""Which rows of a DB are a study's own: the trials that metaid wrote, and none that a deleted study has left behind.

Optuna, its dashboard and others may add trials to a study. Each trial that metaid writes has a mark: a digest of the
settings that the study was created with, and the trial's own number. The own numbers count metaid's trials alone. So
they depend on the settings and the seed, whatever trials of others stand in between. A copy of a trial has the mark of
one that is there already.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from hashlib import blake2b

import sqlalchemy as sa

from metaid.errors import StorageError
from metaid.store.optuna_tables import STUDIES, STUDY_ATTRIBUTES, STUDY_TABLES, TRIAL_ATTRIBUTES, TRIAL_TABLES, TRIALS

MARK = "metaid:trial"  # the attribute of a trial that metaid wrote
DIGEST = "metaid:digest"  # the attribute of a study that its trials' marks begin with
EXPERIMENT = "metaid:experiment"  # the attribute of a trial of others that `metaid.objective` evaluated

_digests, _marks = STUDY_ATTRIBUTES.alias(), TRIAL_ATTRIBUTES.alias()
# Made once: making a statement takes longer than running it.
_ENDING = (
    sa.select(STUDIES.c.study_id, _digests.c.value_json, TRIALS.c.trial_id, TRIALS.c.number, _marks.c.value_json)
    .outerjoin(_digests, (_digests.c.study_id == STUDIES.c.study_id) & (_digests.c.key == DIGEST))
    .outerjoin(TRIALS, (TRIALS.c.study_id == STUDIES.c.study_id) & (TRIALS.c.trial_id >= sa.bindparam("first")))
    .outerjoin(_marks, (_marks.c.trial_id == TRIALS.c.trial_id) & (_marks.c.key == MARK))
    .where(STUDIES.c.study_name == sa.bindparam("study"))
    .order_by(TRIALS.c.trial_id)
)


@dataclass(frozen=True)
class End:
    """Where the trials of a study end: its id and digest, the id of its last trial, whoever wrote it, and the number
    that Optuna gives the next; how many trials are metaid's own, and the id of the last of these.
    """

    study_id: int
    digest: str
    last_id: int
    next_number: int
    count: int
    own_id: int


def digest_of(spec: str) -> str:
    """The digest of a study's settings."""
    return blake2b(spec.encode(), digest_size=6).hexdigest()


def mark_of(digest: str, number: int) -> str:
    """The mark of metaid's trial of this own `number`, as JSON."""
    return f'"{digest}-{number}"'


def own_rows(digest: str, marks: Iterable[str | None], first: int = 0) -> list[bool]:
    """Which trials of a study are metaid's own, by their `marks` in the order in which they were written, None where a
    trial has none; `first` is the own number of the first own one.  Raises ValueError where an own trial is missing.
    """
    own, number, beginning = [], first, f'"{digest}-'
    for mark in marks:
        is_next = mark == mark_of(digest, number)
        if not is_next and mark is not None and mark.startswith(beginning) and int(mark[len(beginning) : -1]) > number:
            raise ValueError(f"trial {number} is missing")
        own.append(is_next)
        number += is_next
    return own


def end_of(connection: sa.Connection, name: str, known: End | None = None) -> End:
    """Where the trials of a study end; the trials before a `known` end are not looked at again.  Raises StorageError
    where there is no such study.
    """
    rows = connection.execute(_ENDING, {"study": name, "first": 0 if known is None else known.own_id}).all()
    if not rows:
        raise StorageError(f"study '{name}' is no longer there")
    study_id, text = rows[0][:2]
    digest = json.loads(text or "null")
    trials = [row[2:] for row in rows if row[2] is not None]
    first = 0
    if known is not None and known.count:
        first = known.count - 1
        expected = known.study_id, known.digest, known.own_id, mark_of(known.digest, first)
        if not trials or (study_id, digest, trials[0][0], trials[0][2]) != expected:
            return end_of(connection, name)  # another study of that name
    own_ids = [
        trial[0] for trial, own in zip(trials, own_rows(digest, [t[2] for t in trials], first), strict=True) if own
    ]
    last_id, last_number = trials[-1][:2] if trials else (0, -1)
    return End(study_id, digest, last_id, last_number + 1, first + len(own_ids), own_ids[-1] if own_ids else 0)


def remove_orphans(connection: sa.Connection) -> None:
    """Removes what a deleted study, or a deleted trial, has left behind in an SQLite file, which allows that: the next
    one that gets its id would inherit it.
    """
    studies = sa.select(STUDIES.c.study_id)
    orphans = sa.select(TRIALS.c.trial_id).where(TRIALS.c.study_id.not_in(studies))
    last = sa.select(sa.func.coalesce(sa.func.max(TRIALS.c.trial_id), 0)).scalar_subquery()
    for table in TRIAL_TABLES:
        connection.execute(sa.delete(table).where(table.c.trial_id.in_(orphans)))
    for table in STUDY_TABLES:
        connection.execute(sa.delete(table).where(table.c.study_id.not_in(studies)))
    for table in TRIAL_TABLES:
        connection.execute(sa.delete(table).where(table.c.trial_id > last))
