"""`metaid study show`, `validate`, `export` and `model`: what a study has found."""

from __future__ import annotations

import contextlib
from pathlib import Path

import click

import metaid
from metaid.cli.common import (
    FIGURE_SUFFIXES,
    PATH,
    json_option,
    open_store,
    print_json,
    print_table,
    say,
    storage_option,
    whole_file,
)
from metaid.cli.studies import name_argument, study
from metaid.errors import optional_packages
from metaid.frames import number_text


@study.command(epilog="\b\nExample:\n  metaid study show three-link --json")
@name_argument
@storage_option
@json_option
@click.option("--bodies", is_flag=True, help="Also what the lumps say of each link: mass, centre of mass, inertia.")
def show(name: str, storage: str, as_json: bool, bodies: bool) -> None:
    """What a study found: every lump beside its nominal value, and the truth where the plant knows it."""
    from threadpoolctl import threadpool_limits

    from metaid.cli.printed import print_study
    from metaid.results import summary

    # At these sizes starting BLAS's threads costs more than all that is computed.
    with open_store(storage) as store, threadpool_limits(1):
        if as_json:
            print_json(summary(store, name, bodies))
        else:
            print_study(store, name, bodies)


VALIDATED = {
    "coasting_s": "coasting, s",
    "coasting_natural_times": "coasting, √(l/g)",
    "coasting_whole_horizon": "pushes that coast throughout",
    "tracking_rms_deg": "rms tracking error, °",
    "tracking_max_deg": "largest, °",
    "tracking_rms_mm": "rms of slides, mm",
    "tracking_max_mm": "largest, mm",
}


@study.command(epilog="\b\nExample:\n  metaid study validate three-link -o tracking.png")
@name_argument
@storage_option
@click.option(
    "--pushes", type=click.IntRange(1, 1000), default=10, show_default=True, help="Pushes that the search never used."
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Random seed of the pushes.")
@json_option
@click.option("-o", "output", type=PATH, help="Draw tracking errors over time (.png, .pdf, .svg).")
def validate(name: str, storage: str, pushes: int, seed: int, as_json: bool, output: Path | None) -> None:
    """Test the identified model: how long the plant coasts with it, and how well it tracks.

    The nominal model is tested likewise, and the true one where the plant knows it.
    """
    validation = metaid.validate(name, storage, pushes, seed)
    if output is not None:
        with whole_file(output, FIGURE_SUFFIXES) as partial:
            metaid.figures.draw_tracking(validation, partial)
    shown = validation.summary()
    if as_json:
        print_json({"study": name, **shown})
        return
    columns = {key: heading for key, heading in VALIDATED.items() if key in shown["models"][0]}
    rows = [[row["model"], *(number_text(row[key], ".3g") for key in columns)] for row in shown["models"]]
    note = (
        f"Coasting is the median of {pushes} new pushes, each watched for {shown['horizon_s']:.3g} s. "
        "Tracking is by computed torque along smooth sinusoids."
    )
    if validation.takes_nominal_inertia:
        note += " Inertia lumps were not searched: each has the nominal model's ratio to its gravity lump."
    print_table(
        f"{name}: validation on {shown['plant']}",
        ["model", *columns.values()],
        rows,
        note,
        dispensable=["coasting, √(l/g)", "largest, °"],
    )


@study.command(epilog="\b\nExample:\n  metaid study export three-link -o trials.csv")
@name_argument
@storage_option
@click.option("-o", "output", type=PATH, required=True, help="FILE.csv or FILE.parquet.")
def export(name: str, storage: str, output: Path) -> None:
    """Write every trial to a file: state, value, generation, steps, periods per joint, factors."""
    if output.suffix == ".parquet":
        with optional_packages("parquet"):
            import pyarrow  # noqa: F401, pandas writes with it

    with whole_file(output, (".csv", ".parquet")) as partial:
        frame = metaid.trials(name, storage)
        if output.suffix == ".csv":
            frame.to_csv(partial, index=False)
        else:
            frame.to_parquet(partial, index=False)
    say(f"{len(frame)} trials are in {output}")


MODEL_HELP = "FILE.toml, .xml (MJCF), .urdf, .py, .h or .json."


@study.command(epilog="\b\nExample:\n  metaid study model three-link -o three-link.xml")
@name_argument
@storage_option
@click.option("-o", "outputs", type=PATH, required=True, multiple=True, help=MODEL_HELP)
@click.option(
    "--even-if-not-found", is_flag=True, help="Where nothing was found, write the last estimate or the best trial."
)
def model(name: str, storage: str, outputs: tuple[Path, ...], even_if_not_found: bool) -> None:
    """Write the identified model to files, to use it elsewhere.

    A plant file, MJCF and URDF have bodies with the identified lumps; their masses are not identified. Python and C
    have the compensation law as a function that needs nothing else, and of a chain the mass matrix.
    """
    from metaid.exporting import SUFFIXES
    from metaid.results import RESULTS

    with contextlib.ExitStack() as files:
        partials = [files.enter_context(whole_file(output, tuple(SUFFIXES))) for output in outputs]
        found = metaid.model(name, storage, even_if_not_found)
        for partial in partials:
            found.write(partial)
    what = f"the {'identified ' * (found.about['verdict'] in RESULTS)}model of '{name}'"
    say(f"{what} is in {', '.join(map(str, outputs))}")
    for note in dict.fromkeys(note for output in outputs for note in found.notes(output.suffix)):
        say(f"{note}.")
