"""What one trial of a study tells, or all of its pushes, as `metaid study check` prints it."""

from __future__ import annotations

from typing import Any

from metaid.cli.checks.until import describe_forecast
from metaid.cli.common import print_table, say
from metaid.frames import UNKNOWN, number_text
from metaid.models import lump_unit
from metaid.study import Problem, Stepping


def print_check(problem: Problem, shown: dict[str, Any]) -> None:
    """Prints what the study of a `problem` can determine, as `metaid.check` says it."""
    (_print_base_parameters if problem.spec.is_arm else _print_lumps)(problem, shown)
    if "until" in shown:
        say(describe_forecast(shown["until"]))
    if "twin" in shown:
        precise = Stepping(**shown["twin"])
        wanted = "" if precise.is_precise else "; that is too much for intervals that hold: shorten the timestep"
        say(
            f"the twin's steps of {1e3 * precise.timestep:g} ms move an angle by {precise.error:.1g} of the noise of a "
            f"reading at most{wanted}"
        )


def _print_lumps(problem: Problem, shown: dict[str, Any]) -> None:
    is_bounded = all(row["high"] is not None for row in shown["lumps"])
    rows = [
        [
            row["name"],
            UNKNOWN if row["resolution"] is None else _share(row["resolution"]),
            _yes(row),
            *([number_text(row["low"]), number_text(row["high"]), lump_unit(row["name"])] if is_bounded else []),
        ]
        for row in shown["lumps"]
    ]
    title = f"{shown['study']}: what {judge_of(problem)} with these pushes can determine"
    headings = ["lump", "to within", "determined", *(["from", "to", "unit"] if is_bounded else [])]
    print_table(title, headings, rows, words=["determined", "unit"], dispensable=["from", "to"])
    if is_bounded:
        moved = ": one that holds the search back is moved away, once"
        bounds = moved if problem.widens else " (search.low, search.high)"
        say(f"a lump beyond from and to is excluded by the bounds{bounds}")
    for combination in shown["undetermined"]:
        terms = sorted(combination.items(), key=lambda term: -abs(term[1]))[:4]
        say(
            "no trial shows a change of these factors together: "
            + " ".join(f"{weight:+.2f} {name}" for name, weight in terms)
        )


def _print_base_parameters(problem: Problem, shown: dict[str, Any]) -> None:
    rows = [
        [
            row["name"],
            number_text(row["nominal"]),
            number_text(row["resolution"], ".2g"),
            _yes(row),
            row["shown_by"],
            row["unit"],
        ]
        for row in shown["lumps"]
    ]
    title = f"{shown['study']}: what one trial of the nominal arm determines"
    headings = ["base parameter", "nominal", "to within", "determined", "shown by", "unit"]
    print_table(title, headings, rows, words=["determined", "shown by", "unit"], dispensable=["nominal", "shown by"])
    if missed := [row["name"] for row in shown["lumps"] if not row["determined"]]:
        say(f"one trial does not determine {', '.join(missed)}: push more, faster, or for longer")


def _yes(row: dict[str, Any]) -> str:
    return "yes" if row["determined"] else "NO"


def judge_of(problem: Problem) -> str:
    """What determines the lumps of a study: its measure, or the estimate where that answers."""
    return "the estimate" if problem.is_told_by_estimate else problem.measure.name


def _share(value: float) -> str:
    return f"{value:.2%}" if value >= 5e-5 else "under 0.01%"
