"""`metaid study compare`."""

from __future__ import annotations

from pathlib import Path

import click

import metaid
from metaid import show
from metaid.cli.common import (
    FIGURE_SUFFIXES,
    PATH,
    json_option,
    print_json,
    print_table,
    say,
    say_reasons,
    storage_option,
    whole_file,
)
from metaid.cli.studies import complete_name, study
from metaid.frames import number_text

EXAMPLE = """\b
Example:
  metaid study run three-link-coast --create
  metaid study compare three-link three-link-coast -o both.html"""


@study.command(epilog=EXAMPLE)
@click.argument("names", metavar="NAME NAME ...", nargs=-1, required=True, shell_complete=complete_name)
@storage_option
@json_option
@click.option("-o", "output", type=PATH, help="A figure (.png, .pdf, .svg), or a page with all (.html).")
def compare(names: tuple[str, ...], storage: str, as_json: bool, output: Path | None) -> None:
    """Studies of the same plant beside one another: what each took, and what it found of each lump."""
    from metaid.cli.printed import PLUS_MINUS, error_text, lump_cells

    found = metaid.compare(*names, storage=storage)
    if output is not None:
        with whole_file(output, (*FIGURE_SUFFIXES, ".html")) as partial:
            if output.suffix == ".html":
                partial.write_text(show.render_comparison(found), encoding="utf-8")
            else:
                metaid.figures.save(metaid.figures.comparison_figure(found), partial)
    shown = found.summary()
    if as_json:
        print_json(shown)
        return
    words = ["sampler", "verdict", "by the"]
    rows = [
        [
            *(str(row[key]) for key in ("name", "sampler", "verdict", "source", "trials", "pruned")),
            number_text(row["seconds"], ".4g"),
            number_text(row["misfit"], ".3g"),
            error_text(row["max_error"], ""),
        ]
        for row in shown["studies"]
    ]
    headings = ["study", *words, "trials", "falls", "motion, s", "misfit", "largest error"]
    dispensable = ["by the", "falls", "misfit", "sampler"]
    print_table("Studies", headings, rows, words=words, dispensable=dispensable)
    for row in shown["studies"]:
        if row["reasons"]:
            say_reasons(row["name"], row["reasons"])
    cells = [[lump["name"], lump["study"], *lump_cells(lump)] for lump in shown["lumps"]]
    columns = ["lump", "study", "nominal", "identified", PLUS_MINUS, "true", "error", "unit"]
    dispensable = ["nominal", "true", PLUS_MINUS, "error", "unit"]
    print_table("What each found", columns, cells, words=["study", "unit"], dispensable=dispensable)
    if output is not None:
        say(f"the comparison is in {output}")
