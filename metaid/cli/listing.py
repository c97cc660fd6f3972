"""`metaid study list`: the studies of a DB, or those that metaid ships."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from metaid.cli.common import json_option, open_store, print_json, print_table, say, storage_option
from metaid.cli.studies import study
from metaid.errors import StudyError
from metaid.frames import json_rows, number_text

SHOWN = ("name", "plant", "sampler", "measure", "verdict", "trials", "pruned")


@study.command("list", epilog="\b\nExample:\n  metaid study list --shipped")
@storage_option
@click.option("--shipped", is_flag=True, help="The studies that metaid ships, in place of those of the DB.")
@json_option
def list_studies(storage: str, shipped: bool, as_json: bool) -> None:
    """The studies of a DB, or those that metaid ships: also where there is no metaid.db here yet."""
    from metaid.cli.printed import error_text
    from metaid.results import studies_frame
    from metaid.store import DEFAULT_STORAGE

    if shipped or (storage == DEFAULT_STORAGE and not Path(storage).exists()):
        rows = _shipped()
        if as_json:
            print_json({"studies": [], "others": [], "shipped": rows})
            return
        _print_shipped(rows)
        if not shipped:
            say(f"there is no {DEFAULT_STORAGE} here yet; make it with one of these: metaid study run NAME --create")
        return
    with open_store(storage) as store:
        frame, others = studies_frame(store), store.other_names()
    rows = json_rows(frame)
    if as_json:
        print_json({"studies": rows, "others": others})
        return
    cells = [
        [*(str(row[key]) for key in SHOWN), number_text(row["best"]), error_text(row["max_error"], "")] for row in rows
    ]
    print_table(
        f"Studies in {store.shown}",
        ["study", "plant", "sampler", "measure", "verdict", "trials", "falls", "best", "largest error"],
        cells,
        words=["plant", "sampler", "measure", "verdict"],
        dispensable=["measure", "falls", "plant", "sampler", "best", "largest error"],
    )
    if others:
        say(f"plain Optuna studies, which metaid did not make: {', '.join(others)}")


def _shipped() -> list[dict[str, Any]]:
    """A row for each study file that metaid ships."""
    from metaid.files import read_toml, shipped_folder, shipped_names

    files = {
        name: read_toml(shipped_folder("studies") / f"{name}.toml", StudyError) for name in shipped_names("studies")
    }
    keys = ("plant", "sampler", "trials", "description")
    return [{"name": name} | {key: file.get(key) for key in keys} for name, file in files.items()]


def _print_shipped(rows: list[dict[str, Any]]) -> None:
    cells = [["" if cell is None else str(cell) for cell in row.values()] for row in rows]
    words = ["plant", "sampler", "description"]
    headings = ["study", "plant", "sampler", "trials", "description"]
    print_table("Shipped studies", headings, cells, words=words, dispensable=["trials", "sampler", "plant"])
