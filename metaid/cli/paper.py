"""`metaid paper …`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from metaid.cli.common import FIGURE_SUFFIXES, PATH, Group, json_option, print_json, print_table, say, whole_file
from metaid.frames import number_text

output_option = click.option("-o", "output", type=PATH, help="Write a picture (.png, .pdf, .svg).")


@click.group(cls=Group, epilog="\b\nExample:\n  metaid paper table1")
def paper() -> None:
    """The paper's results beside ours.

    "pure" is correct dynamics; "like" is a reading that was fitted to the paper's numbers.
    """


@paper.command(epilog="\b\nExample:\n  metaid paper table1 -o table1.png")
@json_option
@output_option
def table1(as_json: bool, output: Path | None) -> None:
    """Table I: periods of one link over the gravity factor."""
    _table(1, as_json, output)


@paper.command(epilog="\b\nExample:\n  metaid paper table2 --json")
@json_option
@output_option
def table2(as_json: bool, output: Path | None) -> None:
    """Table II: periods of two links over the three factors."""
    _table(2, as_json, output)


def _table(number: int, as_json: bool, output: Path | None) -> None:
    from metaid.paper import LIKE, PURE, run_table

    rows = run_table(number)
    _draw(output, "table", rows)
    if as_json:
        print_json(rows)
        return
    pure, like = PURE[number], LIKE[number]
    shown = [
        [
            " ".join(f"{factor:.2f}" for factor in row["factors"].values()),
            _periods(row["paper_periods"], row["paper_falls"]),
            _periods(row["periods"], row["falls"]),
            _differences(row["difference"]),
            _periods(row["complete_periods"], row["falls"]),
            _periods(row["like_periods"], row["like_falls"]),
            _differences(row["like_difference"]),
        ]
        for row in rows
    ]
    columns = ["factors", "paper", f"pure: {pure.rule}", "pure − paper", "pure: complete"]
    columns += [f"like: {like.rule}", "like − paper"]
    print_table(
        f"Table {'I' * number}: periods in 5,000 steps; factors of {', '.join(rows[0]['factors'])}",
        columns,
        shown,
        dispensable=["pure: complete", "pure − paper", "like − paper"],
    )
    say(f"pure: {pure.plant}, push {pure.push} N s at the tip; falls after a push of {pure.fall_push} N s")
    say(f"like: {like.plant}, fitted to these numbers; push {like.push} N s; a link beyond 90° has fallen")
    totals = (sum(abs(d) for row in rows for d in row[key] or ()) for key in ("difference", "like_difference"))
    say("sum of absolute differences: pure {}, like {}".format(*totals))


@paper.command(epilog="\b\nExample:\n  metaid paper fig4 -o fig4.png")
@json_option
@output_option
def fig4(as_json: bool, output: Path | None) -> None:
    """Figure 4: both joint angles, all factors 1.01."""
    from metaid.paper import show_fig4

    shown = show_fig4()
    _draw(output, "fig4")
    if as_json:
        print_json(shown)
        return
    rows = [
        [
            r["reading"],
            r["rule"],
            _periods(r["periods"]),
            _periods(r["complete_periods"]),
            _degrees(r["largest_degrees"]),
        ]
        for r in shown["readings"]
    ]
    rows.insert(0, ["paper", "not stated", _periods(shown["paper_periods"]), "", "axes to ±100"])
    print_table("Fig. 4: all factors 1.01, 5,000 steps", ["", "rule", "periods", "complete", "largest angle, °"], rows)


@paper.command(epilog="\b\nExample:\n  metaid paper sweep -o sweep.png")
@json_option
@output_option
def sweep(as_json: bool, output: Path | None) -> None:
    """Periods against the Coriolis factor f_m1.

    From 0.5 to 1.5, with gravity factors of 1.01: counts of periods do not determine the Coriolis lump.
    """
    from metaid.paper import run_sweep

    rows = run_sweep()
    _draw(output, "sweep", rows)
    if as_json:
        print_json(rows)
        return
    shown = [
        [
            number_text(row["factors"]["coriolis_1_2"], ".2f"),
            _periods(row["periods"]),
            *(number_text(hz, ".6f") for hz in row["frequency_hz"]),
            _periods(row["like_periods"]),
        ]
        for row in rows
    ]
    columns = ["f_m1", "pure: complete", "link 1, Hz", "link 2, Hz", "like: alternations"]
    print_table("Periods of two links over f_m1; pure after a small push", columns, shown)


def _draw(output: Path | None, what: str, *shown: Any) -> None:
    """Writes the picture of `what` is shown."""
    if output is not None:
        from metaid.paper import figures

        with whole_file(output, FIGURE_SUFFIXES) as partial:
            getattr(figures, f"draw_{what}")(*shown, partial)


def _periods(periods: Sequence[int], falls: bool = False) -> str:
    return "falls" if falls else "/".join(map(str, periods))


def _differences(differences: Sequence[int] | None) -> str:
    return "" if differences is None else "/".join(f"{d:+d}" if d else "0" for d in differences)


def _degrees(degrees: Sequence[float]) -> str:
    return " / ".join(f"{angle:.0f}" for angle in degrees)
