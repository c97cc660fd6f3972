"""What one trial of a study tells, or all of its pushes, as `metaid study check` prints it."""

from __future__ import annotations

import math
from dataclasses import asdict
from functools import singledispatch
from typing import Any

from metaid.cli.checks.until import describe_forecast, forecast_row
from metaid.cli.common import number_text, print_json, print_table, say
from metaid.models import COARSEST, lump_unit
from metaid.study import (
    ArmProblem,
    Forecast,
    Problem,
    Stepping,
    arm_identifiability,
    forecast,
    identifiability,
    stepping,
)


@singledispatch
def print_check(problem: Any, until: float | None, as_json: bool) -> None:
    """Prints what the study of a `problem` can determine, and what it takes `until` all is known to that share."""
    raise TypeError(problem)


@print_check.register
def _of_lumps(problem: Problem, until: float | None, as_json: bool) -> None:
    """To within what all pushes tell each lump."""
    found = identifiability(problem)
    foreseen, precise = None if until is None else forecast(problem, until), stepping(problem)
    numbers = found.resolution.tolist(), found.determined, found.low.tolist(), found.high.tolist()
    rows = list(zip(found.names, *numbers, strict=True))
    if as_json:
        lumps = [
            {
                "name": name,
                "resolution": resolution if math.isfinite(resolution) else None,
                "determined": determined,
                "low": low if math.isfinite(high) else None,
                "high": high if math.isfinite(high) else None,
            }
            for name, resolution, determined, low, high in rows
        ]
        print_json(
            {
                "study": problem.spec.name,
                "measure": problem.measure.name,
                "lumps": lumps,
                "undetermined": list(found.combinations),
                **({} if foreseen is None else {"until": forecast_row(foreseen)}),
                **({} if precise is None else {"twin": asdict(precise)}),
            }
        )
        return
    is_bounded = all(math.isfinite(high) for *_, high in rows)
    shown = [
        [
            name,
            _share(resolution) if math.isfinite(resolution) else "–",
            "yes" if determined else "NO",
            *([number_text(low), number_text(high), lump_unit(name)] if is_bounded else []),
        ]
        for name, resolution, determined, low, high in rows
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
    _say_more(foreseen, precise)


@print_check.register
def _of_base_parameters(problem: ArmProblem, until: float | None, as_json: bool) -> None:
    """What one trial tells of each base parameter, and whether coasts show it or springs alone."""
    found = arm_identifiability(problem)
    foreseen, precise = None if until is None else forecast(problem, until), stepping(problem)
    rows = list(
        zip(
            found.names,
            problem.prior.values.tolist(),
            found.resolution.tolist(),
            (found.resolution <= COARSEST * found.beforehand).tolist(),
            ["coasts" if seen else "springs" for seen in found.seen_by_bias],
            found.units,
            found.expressions,
            strict=True,
        )
    )
    if as_json:
        keys = ("name", "nominal", "resolution", "determined", "shown_by", "unit", "expression")
        print_json(
            {
                "study": problem.spec.name,
                "measure": problem.measure.name,
                "lumps": [dict(zip(keys, row, strict=True)) for row in rows],
                **({} if foreseen is None else {"until": forecast_row(foreseen)}),
                **({} if precise is None else {"twin": asdict(precise)}),
            }
        )
        return
    shown = [
        [name, number_text(nominal), number_text(resolution, ".2g"), "yes" if determined else "NO", by, unit]
        for name, nominal, resolution, determined, by, unit, _ in rows
    ]
    title = f"{problem.spec.name}: what one trial of the nominal arm determines"
    headings = ["base parameter", "nominal", "to within", "determined", "shown by", "unit"]
    print_table(title, headings, shown, words=["determined", "shown by", "unit"], dispensable=["nominal", "shown by"])
    missed = [row[0] for row in rows if not row[3]]
    if missed:
        say(f"one trial does not determine {', '.join(missed)}: push more, faster, or for longer")
    _say_more(foreseen, precise)


def _say_more(foreseen: Forecast | None, precise: Stepping | None) -> None:
    """What it takes until all is known, and how precise the twin's steps are, as far as that was asked."""
    if foreseen is not None:
        say(describe_forecast(foreseen))
    if precise is not None:
        wanted = "" if precise.is_precise else "; that is too much for intervals that hold: shorten the timestep"
        say(
            f"the twin's steps of {1e3 * precise.timestep:g} ms move an angle by {precise.error:.1g} of the noise of a "
            f"reading at most{wanted}"
        )


def judge_of(problem: Problem) -> str:
    """What determines the lumps of a study: its measure, or the estimate where that answers."""
    return "the estimate" if problem.is_told_by_estimate else problem.measure.name


def _and_widened(problem: Problem) -> str:
    """What becomes of the bounds, as the end of a sentence."""
    widens = problem.widens_by_itself
    return ": one that holds the search back is moved away, once" if widens else " (search.low, search.high)"


def _share(value: float) -> str:
    return f"{value:.2%}" if value >= 5e-5 else "under 0.01%"
