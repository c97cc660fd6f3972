"""`metaid episode`."""

from __future__ import annotations

from pathlib import Path

import click

import metaid
from metaid.cli.common import (
    FIGURE_SUFFIXES,
    PATH,
    json_option,
    numbers,
    open_store,
    print_json,
    print_table,
    say,
    storage_option,
    warn,
    whole_file,
)
from metaid.cli.plants import plant_argument


@click.command(epilog="\b\nExample:\n  metaid episode three-link --factor gravity_1=1.05 --factor gravity_2=1.05")
@plant_argument
@click.option(
    "--factor",
    "factors",
    metavar="NAME=F",
    multiple=True,
    help="Factor of a lump of the plant (default 1), of an arm of a base parameter or of all; may be repeated.",
)
@click.option(
    "--steps", type=click.IntRange(1, 100_000_000), help="Steps after the push (default: 5000, of an arm 150)."
)
@click.option("--seed", type=click.IntRange(0), help="Of where the push of an arm begins (default: 0).")
@click.option(
    "--nominal",
    type=click.IntRange(0),
    metavar="SEED",
    help="Of an arm: send the law of a nominal arm, drawn as in [nominal] of a study.",
)
@json_option
@click.option("-o", "output", type=PATH, help="Draw joint angles over time (.png, .pdf, .svg).")
@click.option(
    "--video",
    type=PATH,
    help="Film it beside an episode with the true lumps (.mp4, .gif); no screen needed.",
)
@click.option(
    "--study",
    "study_name",
    metavar="NAME",
    help="For --video, of an arm always: film episodes with this study's nominal and identified lumps.",
)
@storage_option
def episode(
    name: str,
    factors: tuple[str, ...],
    steps: int | None,
    seed: int | None,
    nominal: int | None,
    as_json: bool,
    output: Path | None,
    video: Path | None,
    study_name: str | None,
    storage: str,
) -> None:
    """One perturb-and-count episode after a small push at the tip; of an arm one push from a pose in its ranges.

    Factors above 1 over-compensate and oscillate, factors below 1 fall, and 1 coasts.
    """
    if study_name is not None and video is None:
        raise click.UsageError("--study says whose lumps to film: it needs --video FILE.mp4")

    if video is not None:
        from metaid.show import SUFFIXES, film  # first: nothing is drawn where it cannot be filmed

    from metaid.cli.looks import look_at

    plant = metaid.load_plant(name)
    warn([plant.question])
    look = look_at(plant, numbers(factors, "--factor"), steps, seed, nominal)
    if output is not None:
        with whole_file(output, FIGURE_SUFFIXES) as partial:
            look.draw(partial)
    if video is not None:
        laws, problem = look.laws, None
        if study_name is not None:
            from metaid.results import candidates_of

            with open_store(storage) as store:
                problem, laws = candidates_of(store, study_name, plant)
        elif not laws:
            raise click.UsageError(f"--video: plant {plant.name} is an arm (allowed of an arm: with --study NAME)")
        with whole_file(video, SUFFIXES, "--video") as partial:
            film(look.stage(problem), laws, partial)
        if not as_json:
            say(f"the film of '{study_name or plant.name}' is {video}")
    if as_json:
        print_json(look.shown)
        return
    print_table(*look.table, words=["it"])
