"""What one trial of a study tells, or all of its pushes, as `metaid study check` prints it."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from metaid.cli.checks.until import describe_forecast, forecast_row
from metaid.cli.common import number_text, print_json, print_table, say
from metaid.models import lump_unit
from metaid.study import Identifiability, Problem, forecast, identifiability, stepping


def print_check(problem: Problem, until: float | None, as_json: bool) -> None:
    """Prints what the study of a `problem` can determine: to within what all pushes tell each lump, or one trial each
    base parameter; and what it takes `until` all is known to that share.
    """
    found = identifiability(problem)
    foreseen, precise = None if until is None else forecast(problem, until), stepping(problem)
    rows = (_base_parameters if problem.spec.is_arm else _lumps)(problem, found)
    if as_json:
        print_json(
            {
                "study": problem.spec.name,
                "measure": problem.measure.name,
                "lumps": rows,
                **({} if problem.spec.is_arm else {"undetermined": list(found.combinations)}),
                **({} if foreseen is None else {"until": forecast_row(foreseen)}),
                **({} if precise is None else {"twin": asdict(precise)}),
            }
        )
        return
    (_print_base_parameters if problem.spec.is_arm else _print_lumps)(problem, found, rows)
    if foreseen is not None:
        say(describe_forecast(foreseen))
    if precise is not None:
        wanted = "" if precise.is_precise else "; that is too much for intervals that hold: shorten the timestep"
        say(
            f"the twin's steps of {1e3 * precise.timestep:g} ms move an angle by {precise.error:.1g} of the noise of a "
            f"reading at most{wanted}"
        )


def _lumps(problem: Problem, found: Identifiability) -> list[dict[str, Any]]:
    """A row a lump; None where it cannot be found, or is not bounded."""
    numbers = found.resolution.tolist(), found.determined, found.low.tolist(), found.high.tolist()
    return [
        {
            "name": name,
            "resolution": resolution if math.isfinite(resolution) else None,
            "determined": determined,
            "low": low if math.isfinite(high) else None,
            "high": high if math.isfinite(high) else None,
        }
        for name, resolution, determined, low, high in zip(found.names, *numbers, strict=True)
    ]


def _print_lumps(problem: Problem, found: Identifiability, rows: list[dict[str, Any]]) -> None:
    is_bounded = all(row["high"] is not None for row in rows)
    shown = [
        [
            row["name"],
            "–" if row["resolution"] is None else _share(row["resolution"]),
            _yes(row),
            *([number_text(row["low"]), number_text(row["high"]), lump_unit(row["name"])] if is_bounded else []),
        ]
        for row in rows
    ]
    title = f"{problem.spec.name}: what {judge_of(problem)} with these pushes can determine"
    headings = ["lump", "to within", "determined", *(["from", "to", "unit"] if is_bounded else [])]
    print_table(title, headings, shown, words=["determined", "unit"], dispensable=["from", "to"])
    if is_bounded:
        say(f"a lump beyond from and to is excluded by the bounds{_and_widened(problem)}")
    for combination in found.combinations:
        terms = sorted(combination.items(), key=lambda term: -abs(term[1]))[:4]
        say(
            "no trial shows a change of these factors together: "
            + " ".join(f"{weight:+.2f} {name}" for name, weight in terms)
        )


def _base_parameters(problem: Problem, found: Identifiability) -> list[dict[str, Any]]:
    """A row a base parameter, with the pushes that show it."""
    sought = problem.robot.sought
    keys = "name", "nominal", "resolution", "determined", "shown_by", "unit", "expression"
    columns = sought.nominal.tolist(), found.resolution.tolist(), found.determined
    told = zip(found.names, *columns, found.shown_by or (), sought.units, sought.expressions or (), strict=True)
    return [dict(zip(keys, row, strict=True)) for row in told]


def _print_base_parameters(problem: Problem, found: Identifiability, rows: list[dict[str, Any]]) -> None:
    shown = [
        [
            row["name"],
            number_text(row["nominal"]),
            number_text(row["resolution"], ".2g"),
            _yes(row),
            row["shown_by"],
            row["unit"],
        ]
        for row in rows
    ]
    title = f"{problem.spec.name}: what one trial of the nominal arm determines"
    headings = ["base parameter", "nominal", "to within", "determined", "shown by", "unit"]
    print_table(title, headings, shown, words=["determined", "shown by", "unit"], dispensable=["nominal", "shown by"])
    if missed := found.undetermined_names:
        say(f"one trial does not determine {', '.join(missed)}: push more, faster, or for longer")


def _yes(row: dict[str, Any]) -> str:
    return "yes" if row["determined"] else "NO"


def judge_of(problem: Problem) -> str:
    """What determines the lumps of a study: its measure, or the estimate where that answers."""
    return "the estimate" if problem.is_told_by_estimate else problem.measure.name


def _and_widened(problem: Problem) -> str:
    """What becomes of the bounds, as the end of a sentence."""
    widens = problem.widens_by_itself
    return ": one that holds the search back is moved away, once" if widens else " (search.low, search.high)"


def _share(value: float) -> str:
    return f"{value:.2%}" if value >= 5e-5 else "under 0.01%"
