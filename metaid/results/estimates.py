"""What is said of the estimate of a study: of which trials it is, how early it was there, what it is worth."""

from __future__ import annotations

from typing import Any

from metaid.results.verdict import RESULTS
from metaid.study.estimates import CLOSE, FIRST_TRIALS, interval_name


def estimate_texts(summary: dict[str, Any]) -> dict[str, Any]:
    """What is said of the estimate in a `summary`: which trials it is `of`, and a sentence on what it is `worth`, or
    why there is none; where the study stands by it how early it was `known`, if it explains what was seen, and what its
    `interval` is called.
    """
    shown, total = summary["estimate"], summary["trials"]["total"]
    if shown is None:
        return {"of": None, "worth": f"No estimate: {summary['why_no_estimate']}.", "known": None, "interval": None}
    of, stands = _trials(shown, total), summary["verdict"] in RESULTS and summary["source"] == "estimate"
    return {
        "of": of,
        "worth": f"Estimate from {of}: {shown['description']}.",
        "known": _known_from(shown, total) if stands and shown["explains"] else None,
        "interval": interval_name(shown["counts"]) if stands else None,
    }


def _trials(shown: dict[str, Any], total: int) -> str:
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


def _known_from(shown: dict[str, Any], total: int) -> str:
    """How early the estimate in a `summary` was there, of `total` trials of the study."""
    total += shown.get("by_others", 0)
    if shown["counts"] is not None:
        return "every trial narrows the set of models"
    known, first = shown["known_from"], min(FIRST_TRIALS, shown["trials"])
    if known is None:
        return f"after the first {first} of {total} trials some lump still moved by more than {CLOSE:.1%}"
    which = "the first" if known == 1 else f"the first {known}"
    return f"after {which} of {total} trials no lump moved by more than {CLOSE:.1%}"
