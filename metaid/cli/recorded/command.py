"""The command `metaid estimate`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from metaid.cli.common import json_option, print_json, print_table, refuse_output, say, whole_file
from metaid.cli.printed import lump_cells

MODEL_HELP = "Write the model: .toml, .xml (MJCF), .urdf, .py, .h, .json."
PLANT_HELP = "The plant that you believe: a name, a plant file, an MJCF or URDF."
COLUMNS = ("nominal", "identified", "low", "high")
NOT_FOUND = 3  # exit status


@click.command(epilog="\b\nExample:\n  metaid estimate --record log.csv --plant three-link -o model.xml")
@click.option("--record", "path", type=click.Path(path_type=Path), required=True, help="The log: .csv or .parquet.")
@click.option("--plant", required=True, help=PLANT_HELP)
@click.option("--law", metavar="PLANT", help="The torques were those that compensate this plant.")
@click.option(
    "--friction", metavar="TERMS", help="Of: viscous,coulomb,root,offset,rotor; default all but rotor; or none."
)
@click.option("--couple", "couples", metavar="I,J", multiple=True, help="Two joints whose motors are coupled.")
@click.option("--window", type=click.FloatRange(0.001, 100.0), help="Length of the windows, in s.")
@click.option("--delay", type=click.FloatRange(-1.0, 1.0), help="Of the torques, in s; by default it is found.")
@click.option("-o", "output", type=click.Path(path_type=Path), help=MODEL_HELP)
@json_option
def estimate(
    path: Path,
    plant: str,
    law: str | None,
    friction: str | None,
    couples: tuple[str, ...],
    window: float | None,
    delay: float | None,
    output: Path | None,
    as_json: bool,
) -> int:
    """Identify a plant from a log of its motion.

    The log has a column `time` in s and, of every joint, `angle_1` in rad, `torque_1` in N m and perhaps `speed_1` in
    rad/s. A torque holds until the next row. All that is found scales with the torques: currents are none until they
    are multiplied by the motors' constants. The exit status is 3 where nothing is found.
    """
    from metaid.recorded import Choices, identify_record
    from metaid.results.exporting import SUFFIXES

    terms = None if friction is None else [term for term in friction.split(",") if term and friction != "none"]
    pairs = [_pair(text) for text in couples]
    if output is not None:
        refuse_output(output, tuple(SUFFIXES))
    found = identify_record(
        path, plant, law=law, friction=terms, coupled=pairs, choices=Choices(span=window, delay=delay)
    )
    if as_json:
        print_json(found.summary)
    else:
        _print(found.summary)
    if not found.verdict.is_found:
        return NOT_FOUND
    if output is not None:
        model = found.model
        with whole_file(output, tuple(SUFFIXES)) as partial:
            model.write(partial)
        for line in (
            () if as_json else (f"the model is in {output}", *(f"{note}." for note in model.notes(output.suffix)))
        ):
            say(line)
    return 0


def _pair(text: str) -> tuple[int, int]:
    """`I,J` as two numbers of joints."""
    try:
        one, other = (int(each) for each in text.split(","))
    except ValueError:
        raise click.UsageError(f"--couple '{text}' (allowed: two numbers of joints, as 5,6)") from None
    return one, other


def _print(shown: dict[str, Any]) -> None:
    """The table of what is unknown, then the verdict."""
    from metaid.models import DEVIATIONS

    rows = [[lump["name"], *lump_cells(lump)[: len(COLUMNS)], lump["unit"]] for lump in shown["lumps"]]
    read = shown["record"]
    late = f"torques {1e3 * read['delay_s']:.3g} ms late" + (
        f" (± {1e3 * DEVIATIONS * read['delay_sd_s']:.2g})" if read["delay_sd_s"] else ""
    )
    note = (
        f"{read['rows']} rows in {read['seconds']:.4g} s, of which {read['moving_s']:.4g} s move, "
        f"in {read['windows']} windows of {read['window_s']:g} s; {late}"
    )
    print_table(f"{shown['name']}: {shown['plant']}", ["lump", *COLUMNS, "unit"], rows, note, words=["unit"])
    known = sum(lump["determined"] for lump in shown["lumps"])
    head = [f"{known} of {len(shown['lumps'])} unknowns"] if shown["verdict"] == "found" else []
    say(f"{shown['verdict'].upper()}: {'; '.join([*head, *shown['reasons']])}")
