"""A study in the terminal, as `metaid study show` prints it and `metaid study run` at its end."""

from __future__ import annotations

from typing import Any

import click

from metaid.cli.common import number_text, print_table, say

PARAMETER_COLUMNS = ("nominal", "low", "high", "true")


def print_study(store: Any, name: str) -> None:
    """Every lump beside its nominal value, and the truth where the plant knows it; what was tried, and the best."""
    from metaid.episode import MEASURES
    from metaid.results import summary

    shown = summary(store, name)
    rows = [
        [
            lump["name"],
            *(number_text(lump[key]) for key in ("nominal", "identified", "low", "high", "true")),
            number_text(lump["error"], "+.3%"),
            lump["unit"],
        ]
        for lump in shown["lumps"]
    ]
    trials, best = shown["trials"], shown["best"]
    title = f"{shown['name']}: {shown['plant']}, {shown['sampler']}, {shown['measure']}, seed {shown['seed']}"
    largest = "" if shown["max_error"] is None else f"; largest error {shown['max_error']:.3%}"
    unit = MEASURES[shown["measure"]].unit
    found = "no survivor yet"
    if best["value"] is not None:
        found = f"best {best['value']:.3g} {unit} at trial {best['number']}{largest}"
    if "noise_floor_hz" in shown:
        found += f"; noise floor {shown['noise_floor_hz']:.3g} Hz, subtracted"
    if "mujoco" in best:
        found += f"; {_verification(best['mujoco'])}"
    for stage in shown.get("stages", [])[1:]:
        if stage["best"]["value"] is not None:
            found += f"; stage 2: best {stage['best']['value']:.3g} {unit} at trial {stage['best']['number']}"
    failed = f", {trials['failed']} failed" if trials["failed"] else ""
    note = f"{trials['total']} trials, {trials['pruned']} of them falls{failed}; {found}"
    print_table(
        title, ["lump", "nominal", "identified", "low", "high", "true", "error", "unit"], rows, note, words=["unit"]
    )
    if "parameters" in shown:
        _show_parameters(shown)
    missed = [lump["name"] for lump in shown["lumps"] if not lump["determined"]]
    if missed:
        say(f"not identified: {', '.join(missed)}: {shown['measure']} with these pushes cannot determine them")


def _show_parameters(shown: dict[str, Any]) -> None:
    from metaid.results import describe_bodies

    rows = [
        [row["name"], *(number_text(row[key]) for key in PARAMETER_COLUMNS), row["unit"]] for row in shown["parameters"]
    ]
    print_table("Bodies that move the same", ["parameter", *PARAMETER_COLUMNS, "unit"], rows, words=["unit"])
    click.echo(describe_bodies(shown))


def _verification(mujoco: dict[str, Any]) -> str:
    outcome = "it falls in MuJoCo" if mujoco["fell"] else f"MuJoCo gives {mujoco['value']:.3g}"
    return f"found with analytic physics, {outcome}: {'verified' if mujoco['agrees'] else 'NOT VERIFIED'}"
