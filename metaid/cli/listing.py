"""`metaid study list`: the studies of a DB, or those that metaid ships."""

from __future__ import annotations

import click

from metaid.cli.common import number_text, open_store, print_table, say, storage_option
from metaid.cli.printed import error_text


@click.command("list", epilog="\b\nExample:\n  metaid study list --shipped")
@storage_option
@click.option("--shipped", is_flag=True, help="The studies that metaid ships, in place of those of the DB.")
def list_studies(storage: str, shipped: bool) -> None:
    """The studies of a DB, or those that metaid ships."""
    from metaid.results import studies_frame

    if shipped:
        _print_shipped()
        return
    with open_store(storage) as store:
        frame, others = studies_frame(store), store.other_names()
    words, counts = ("name", "plant", "sampler", "measure", "verdict"), ("trials", "pruned")
    rows = [
        [
            *(row[key] for key in words),
            *(str(row[key]) for key in counts),
            number_text(row["best"]),
            error_text(row["max_error"], ""),
        ]
        for row in frame.to_dict("records")
    ]
    print_table(
        f"Studies in {store.shown}",
        ["study", "plant", "sampler", "measure", "verdict", "trials", "falls", "best", "largest error"],
        rows,
        words=words,
        dispensable=["measure", "falls", "plant", "sampler", "best", "largest error"],
    )
    if others:
        say(f"plain Optuna studies, which metaid did not make: {', '.join(others)}")


def _print_shipped() -> None:
    """A line for each study file that metaid ships."""
    from metaid.errors import StudyError
    from metaid.files import read_toml, shipped_folder, shipped_names

    files = {
        name: read_toml(shipped_folder("studies") / f"{name}.toml", StudyError) for name in shipped_names("studies")
    }
    rows = [
        [name, str(file["plant"]), str(file.get("sampler", "")), str(file.get("trials", "")), file["description"]]
        for name, file in files.items()
    ]
    words = ["plant", "sampler", "description"]
    headings = ["study", "plant", "sampler", "trials", "description"]
    print_table("Shipped studies", headings, rows, words=words, dispensable=["trials", "sampler", "plant"])
