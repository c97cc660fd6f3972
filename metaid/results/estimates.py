"""What is said of the estimate of a study: why there is none, of which trials it is, how early it was there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol

from metaid.store import Trial
from metaid.study import Problem
from metaid.study.estimates import CLOSE, FIRST_TRIALS

if TYPE_CHECKING:
    from metaid.estimation import Approximation


def why_no_estimate(problem: Problem, tried: Sequence[Trial]) -> str:
    """Why there is no estimate from the trials that were `tried` in the study of this `problem`."""
    if not problem.spec.study.estimate.enabled:
        return "[estimate] enabled is false"
    if not problem.can_be_estimated:
        return "its episodes keep no windows of motion"
    if not tried:
        return "it has no trial yet: run it first"
    windows = [each.outcome.windows.seen for each in tried if each.outcome.windows is not None]
    readings = [each.outcome.readings.steps for each in tried if each.outcome.readings is not None]
    if not windows and not readings:
        return f"no trial in the DB has {'readings' if problem.keeps_readings else 'windows of its motion'}"
    if not any(each.any() for each in (*windows, *readings)):
        return "every trial fell within its shortest window"
    return "the twin cannot follow these trials from any chain near the nominal one"


def describe_trials(shown: dict[str, Any], total: int) -> str:
    """Which of the `total` trials of a study the estimate in its `summary` is made of, and which of others."""
    others = shown.get("by_others", 0)
    count = shown["trials"] - others
    if not count:
        return f"{others} trials of others"
    if count == 1:
        text = "the first trial" if total > 1 else "one trial"
    else:
        text = f"all {count} trials" if count == total else f"the first {count} trials"
    return f"{text} and {others} of others" if others else text


def describe_known_from(shown: dict[str, Any], total: int) -> str:
    """How early the estimate in a `summary` was there, of `total` trials of the study."""
    total += shown.get("by_others", 0)
    if shown["counts"] is not None:
        return "every trial narrows the set of models"
    known, first = shown["known_from"], min(FIRST_TRIALS, shown["trials"])
    if known is None:
        return f"the first {first} of {total} trials were not enough to know every lump to {CLOSE:.1%}"
    which = "the first" if known == 1 else f"the first {known}"
    return f"every lump was known to {CLOSE:.1%} after {which} of {total} trials"


class Approximated(Protocol):
    """An estimate of a chain or of an arm."""

    @property
    def approximation(self) -> Approximation | None:
        """What it is worth where it does not explain what was seen to the noise."""


def approximation_rows(found: Approximated, verdict: str) -> dict[str, Any]:
    """What pushes that were left out say of an estimate that was `found`, as `study show --json` has it under
    `estimate`; nothing where the `verdict` did not ask them.
    """
    worth = found.approximation if verdict in ("approximate", "not found") else None
    return {} if worth is None else worth.summary()
