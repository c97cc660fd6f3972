"""`metaid study check` of a study of an arm."""

from __future__ import annotations

from typing import TYPE_CHECKING

from metaid.cli.common import number_text, print_json, print_table, say

if TYPE_CHECKING:
    from metaid.study import ArmSpec


def check_arm(spec: ArmSpec, as_json: bool) -> None:
    """What one trial of the study tells of each base parameter, and whether coasts show it or springs alone."""
    from metaid.study import COARSEST, arm_identifiability, problem_of

    problem = problem_of(spec)
    found = arm_identifiability(problem)
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
                "study": spec.name,
                "measure": problem.measure.name,
                "lumps": [dict(zip(keys, row, strict=True)) for row in rows],
            }
        )
        return
    shown = [
        [name, number_text(nominal), number_text(resolution, ".2g"), "yes" if determined else "NO", by, unit]
        for name, nominal, resolution, determined, by, unit, _ in rows
    ]
    title = f"{spec.name}: what one trial of the nominal arm determines"
    headings = ["base parameter", "nominal", "to within", "determined", "shown by", "unit"]
    print_table(title, headings, shown, words=["determined", "shown by", "unit"], dispensable=["nominal", "shown by"])
    missed = [row[0] for row in rows if not row[3]]
    if missed:
        say(f"one trial does not determine {', '.join(missed)}: push more, faster, or for longer")
