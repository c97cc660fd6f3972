"""`metaid plant …`."""

from __future__ import annotations

import click

import metaid
from metaid.cli.common import Group, json_option, names_of, print_json, print_table
from metaid.errors import PlantError


def _complete_plant(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    from metaid.files import shipped_names

    return [name for name in shipped_names("plants") if name.startswith(incomplete)]


plant_argument = click.argument("name", metavar="PLANT", shell_complete=_complete_plant)


@click.group(cls=Group, epilog="\b\nExample:\n  metaid plant show three-link")
def plant() -> None:
    """Pendulums and arms that can be identified."""


@plant.command("list", epilog="\b\nExample:\n  metaid plant list")
@json_option
def list_plants(as_json: bool) -> None:
    """Shipped plants; a plant file of your own is given by its path."""
    from metaid.files import shipped_names

    plants = [metaid.load_plant(name) for name in shipped_names("plants")]
    rows = [{"name": shown.name, "joints": shown.njoint, "description": shown.settings.description} for shown in plants]
    if as_json:
        print_json({"plants": rows})
        return
    cells = [[str(cell) for cell in row.values()] for row in rows]
    print_table("Plants", ["plant", "joints", "description"], cells, words=["description"])


@plant.command("show", epilog="\b\nExample:\n  metaid plant show three-link --json")
@plant_argument
@click.option("--joints", metavar="A,B,…", help="Of an MJCF or URDF those that move; the others are held.")
@json_option
def show_plant(name: str, joints: str | None, as_json: bool) -> None:
    """The links of a plant, and its true lumps where it knows them; of an arm its joints and links."""
    from metaid.cli.shown_plants import show
    from metaid.files import find_file
    from metaid.plant import read_any_plant, with_joints

    path = find_file("plants", name, PlantError)
    show(with_joints(read_any_plant(path), names_of(joints), path), path.stem, as_json)
