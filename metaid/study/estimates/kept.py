"""The estimate that is kept with a study in the DB, and whether it is still that of its trials.

A run makes it once its trials are there, and writes it while the study is its own. Whoever reads the study reads it.
A reader makes it anew, and writes nothing, where the kept one is of other trials, as when others have added some or a
run was killed, and where another version of metaid made it. What is made anew is read back from its text as well, so
both are the same to the last bit. It is a system attribute of the study, which Optuna's tools do not show.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

import metaid
from metaid.store import ForeignTrial, Lease, Store, Trial
from metaid.study.estimates.making import estimate_of, watched_trials
from metaid.study.estimates.study_estimate import StudyEstimate
from metaid.study.estimates.text import text_of, value_of
from metaid.study.problem import Problem

KEY = "metaid:estimate"
SOURCES = "models", "plant", "episode", "compiled", "estimation", "study"  # the packages that an estimate follows from


def keep_estimate(lease: Lease, problem: Problem) -> None:
    """Keeps the estimate of all trials in the DB with the study of a `problem`, unless it is there; the `lease` is by
    which this driver holds it.  Raises StorageError where the DB cannot be used, or another driver has taken the study.
    """
    store, name = lease.store, lease.name
    stored = store.read(name, problem.spec.names)
    is_of = _is_of(problem, stored.own, stored.foreign)
    kept = kept_with(store, name)
    if not (isinstance(kept, dict) and kept.get("of") == is_of):
        made = {"of": is_of, "estimate": _made(problem, stored.own, stored.foreign)}
        store.set_attribute(name, KEY, made, shown=False, write_check=lease.renew)


def kept_with(store: Store, name: str) -> Any:
    """What the DB has of the estimate of a study; None where it has nothing."""
    return store.attribute(name, KEY, shown=False)


def estimate_from(kept: Any, problem: Problem, trials: Sequence[Trial], foreign: Sequence[ForeignTrial] = ()) -> Any:
    """What all trials of a study say, a `StudyEstimate`; None where nothing can be made of them.

    Args:
        kept: what the DB has of it.
        problem: the study's.
        trials: metaid's own.
        foreign: those of others, with the motion that they carry.
    """
    given = {"seen": lambda: watched_trials(problem, trials, foreign)[:2], "searched": problem.robot.unknowns}
    try:
        if kept["of"] == _is_of(problem, trials, foreign):
            found = value_of(kept["estimate"], given)
            if found is None or isinstance(found, StudyEstimate):
                return found
    except (ValueError, TypeError, LookupError, AttributeError):
        pass  # there is none, or one that metaid did not write
    return value_of(_made(problem, trials, foreign), given)


def _made(problem: Problem, trials: Sequence[Trial], foreign: Sequence[ForeignTrial]) -> str:
    """The text of the estimate that is made of all trials."""
    with threadpool_limits(1):  # at these sizes BLAS threads cost far more than they give
        experiment, watched, others = watched_trials(problem, trials, foreign)
        return text_of(None if experiment is None else estimate_of(experiment, watched, others))


def _is_of(problem: Problem, trials: Sequence[Trial], foreign: Sequence[ForeignTrial]) -> dict[str, Any]:
    """What an estimate is of: the settings and the code that it follows from, how many trials metaid wrote, and which
    of others carry motion.
    """
    made_by = blake2b(f"{_code()}{problem.spec.model_dump_json()}".encode(), digest_size=10).hexdigest()
    return {"made_by": made_by, "trials": len(trials), "others": [each.number for each in foreign if each.shown]}


@cache
def _code() -> str:
    """A digest of the sources that an estimate follows from."""
    found = blake2b(metaid.__version__.encode(), digest_size=10)
    for package in SOURCES:
        for path in sorted((Path(metaid.__file__).parent / package).rglob("*.py")):
            found.update(path.read_bytes())
    return found.hexdigest()
