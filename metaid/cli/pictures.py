"""What shows things: `metaid plant draw | view`, `metaid study plot | report`, `metaid dashboard`."""

from __future__ import annotations

from pathlib import Path

import click

import metaid
from metaid import show
from metaid.cli.common import FIGURE_SUFFIXES, PATH, open_store, say, storage_option, warn, whole_file, working
from metaid.cli.plants import plant, plant_argument
from metaid.cli.studies import name_argument, study
from metaid.errors import MetaidError


@plant.command(epilog="\b\nExample:\n  metaid plant draw three-link -o plant.png")
@plant_argument
@click.option("-o", "output", type=PATH, required=True, help="FILE.png, .pdf or .svg.")
def draw(name: str, output: Path) -> None:
    """Draw a labelled sketch of a plant: lengths, masses, centres of mass; of an arm its shapes and joints at home."""
    shown = metaid.load_plant(name)
    warn([shown.question])
    figure = metaid.figures.plant_figure(shown)
    with whole_file(output, FIGURE_SUFFIXES) as partial:
        metaid.figures.save(figure, partial)


@plant.command(epilog="\b\nExample (needs a screen):\n  metaid plant view three-link")
@plant_argument
def view(name: str) -> None:
    """Open a plant in MuJoCo's viewer: a chain stands upright, an arm is at home; it falls when touched."""
    show.open_viewer(metaid.load_plant(name))


@study.command(epilog="\b\nExample:\n  metaid study plot three-link -o figures --format pdf --width column")
@name_argument
@storage_option
@click.option("-o", "folder", metavar="DIR", type=PATH, required=True, help="Folder, made if need be.")
@click.option("--format", "ending", type=click.Choice(["png", "svg", "pdf"]), default="png", show_default=True)
@click.option(
    "--width", type=click.Choice(["page", "column"]), default="page", show_default=True, help="7 or 3.5 inches."
)
@click.option("--over", nargs=2, metavar="LUMP LUMP", help="Lumps of the fall boundary (default: the first two).")
def plot(name: str, storage: str, folder: Path, ending: str, width: str, over: tuple[str, str] | None) -> None:
    """Draw a study's figures: convergence, factors, ranges, frequency, fall boundary, …

    Of an arm also how well base parameters are known. A file each, named after what it shows, at the width of a
    journal's page or column.
    """
    gallery = metaid.figures.Gallery(metaid.load_findings(name, storage), over)
    try:
        folder.mkdir(exist_ok=True)
    except OSError as problem:
        raise MetaidError(f"{folder}: {problem.strerror}") from None
    shown = list(gallery.pictures(width))
    for picture in shown:
        with whole_file(folder / f"{picture.name}.{ending}", FIGURE_SUFFIXES) as partial:
            metaid.figures.save(picture.figure, partial)
    say(f"{len(shown)} figures are in {folder}: {', '.join(picture.name for picture in shown)}")


@study.command(epilog="\b\nExample:\n  metaid study report three-link -o report.html")
@name_argument
@storage_option
@click.option("-o", "output", type=PATH, required=True, help="FILE.html.")
def report(name: str, storage: str, output: Path) -> None:
    """Write one self-contained page: what was searched, what was found, figures, cost, how to repeat it."""
    with whole_file(output, (".html",)) as partial, working("estimate") as watch:
        partial.write_text(show.render(metaid.load_findings(name, storage), watch), encoding="utf-8")
    say(f"the report of '{name}' is {output}")


@click.command(epilog="\b\nExample (until Ctrl-C):\n  metaid dashboard --port 8080")
@storage_option
@click.option("--port", type=click.IntRange(0, 65535), default=8080, show_default=True, help="0 takes any free one.")
def dashboard(storage: str, port: int) -> None:
    """Open optuna-dashboard on the study DB, for this machine alone.

    Every study gets a note that explains it and our figures; of more than 10,000 trials a thinned companion is shown.
    """
    with open_store(storage) as store:
        show.serve(store, port, say)
