"""What is said of the estimate of a study: of which trials it is, how early it was there, what it is worth."""

from __future__ import annotations

from typing import Any

from metaid.study.estimates import CLOSE, FIRST_TRIALS


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
        return f"after the first {first} of {total} trials some lump still moved by more than {CLOSE:.1%}"
    which = "the first" if known == 1 else f"the first {known}"
    return f"after {which} of {total} trials no lump moved by more than {CLOSE:.1%}"
