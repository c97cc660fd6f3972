"""`metaid plant …` and `metaid episode`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from metaid.cli.common import (
    FIGURE_SUFFIXES,
    Group,
    json_option,
    lump_rows,
    number_text,
    numbers,
    open_store,
    print_json,
    print_lumps,
    print_table,
    say,
    storage_option,
    whole_file,
)

if TYPE_CHECKING:
    from metaid.plant import SocketSettings


def _complete_plant(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    from metaid.files import shipped_names

    return [name for name in shipped_names("plants") if name.startswith(incomplete)]


plant_argument = click.argument("name", metavar="PLANT", shell_complete=_complete_plant)


@click.group(cls=Group, epilog="\b\nExample:\n  metaid plant show three-link")
def plant() -> None:
    """Pendulums and arms that can be identified."""


@plant.command("list", epilog="\b\nExample:\n  metaid plant list")
def list_plants() -> None:
    """Shipped plants; a plant file of your own is given by its path."""
    from metaid.files import shipped_names
    from metaid.plant import load_plant

    plants = [load_plant(name) for name in shipped_names("plants")]
    rows = [[shown.name, str(shown.njoint), shown.settings.description] for shown in plants]
    print_table("Plants", ["plant", "joints", "description"], rows, words=["description"])


@plant.command("show", epilog="\b\nExample:\n  metaid plant show three-link --json")
@plant_argument
@json_option
def show_plant(name: str, as_json: bool) -> None:
    """The links of a plant, and its true lumps where it knows them; of an arm its joints and links."""
    from metaid.errors import PlantError
    from metaid.files import find_file
    from metaid.plant import ArmPlant, ArmSettings, MujocoPlant, SocketSettings, read_any_plant

    path = find_file("plants", name, PlantError)
    settings = read_any_plant(path)
    if isinstance(settings, ArmSettings):
        from metaid.cli.arms import show_arm

        show_arm(ArmPlant(path.stem, settings), as_json)
        return
    if isinstance(settings, SocketSettings):
        _show_rig(path.stem, settings, as_json)
        return
    shown = MujocoPlant(path.stem, settings)
    chain, truth = shown.chain, shown.true_lumps()
    columns = ("length", "mass", "com", "inertia", "damping", "coulomb", "stiffness")
    links = [
        dict(zip(columns, map(float, row), strict=True))
        for row in zip(*(getattr(chain, column) for column in columns), strict=True)
    ]
    lumps = lump_rows(chain.lumps_of(chain.kinds))
    if truth is None:
        lumps = [{**lump, "true": None} for lump in lumps]
    if as_json:
        common = {key: getattr(shown.settings, key) for key in ("gravity", "timestep", "over_compensation")}
        faults = shown.settings.faults.model_dump(mode="json")
        print_json({"plant": shown.name, **common, "faults": faults, "links": links, "lumps": lumps})
        return
    heading = ["link", "length, m", "mass, kg", "com, m", "inertia, kg m²", "damping, N m s", "dry friction, N m"]
    heading.append("stiffness, N m/rad")
    dispensable = ["stiffness, N m/rad", "dry friction, N m", "damping, N m s"]
    fault = shown.settings.over_compensation
    rows = [[str(i + 1), *(number_text(link[column]) for column in columns)] for i, link in enumerate(links)]
    print_table(
        f"{shown.name}: {shown.settings.description}",
        heading,
        rows,
        f"gravity {shown.gravity} m/s², timestep {shown.timestep} s"
        + (f"; declared fault: the torque that it receives has gravity factors larger by {fault}" if fault else "")
        + "".join(f"; {name} {value}" for name, value in shown.settings.faults.named.items()),
        dispensable=dispensable,
    )
    print_lumps("True lumps", lumps)


def _show_rig(name: str, settings: SocketSettings, as_json: bool) -> None:
    """What is known of a plant behind a socket; it is not called for that."""
    from metaid.models import lump_names, lump_unit

    names = lump_names(settings.joints)
    if as_json:
        lumps = [{"name": lump, "unit": lump_unit(lump), "true": None} for lump in names]
        print_json({"plant": name, **settings.model_dump(exclude={"description"}), "links": [], "lumps": lumps})
        return
    rows = [[key, str(value)] for key, value in settings.model_dump(exclude={"description"}).items()]
    note = f"This plant is a rig, so its {len(names)} true lumps are not known."
    print_table(f"{name}: {settings.description}", ["setting", "value"], rows, note, words=["value"])


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
@click.option("-o", "output", type=click.Path(path_type=Path), help="Draw joint angles over time (.png, .pdf, .svg).")
@click.option(
    "--video",
    type=click.Path(path_type=Path),
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
    from metaid import api
    from metaid.plant import ArmPlant, load_plant
    from metaid.study import COUNTING_STEPS

    if study_name is not None and video is None:
        raise click.UsageError("--study says whose lumps to film: it needs --video FILE.mp4")

    if video is not None:
        from metaid.show import SUFFIXES, ChainStage, film  # first: nothing is drawn where it cannot be filmed

    plant = load_plant(name)
    if isinstance(plant, ArmPlant):
        from metaid.cli.arms import draw_push_to, film_study_of_arm, show_push

        push = api.arm_push(plant, numbers(factors, "--factor"), steps, seed or 0, nominal)
        if output is not None:
            draw_push_to(push, output)
        if video is not None:
            film_study_of_arm(plant, study_name, storage, video)
            if not as_json:
                say(f"the film of '{study_name}' is {video}")
        show_push(push, as_json)
        return
    if given := [option for option, value in (("--seed", seed), ("--nominal", nominal)) if value is not None]:
        raise click.UsageError(f"{given[0]} is of an arm, and plant {plant.name} is a planar chain (allowed: --factor)")
    steps = COUNTING_STEPS if steps is None else steps
    objective = api.episode_objective(plant, steps)
    candidate = api.check_factors(numbers(factors, "--factor"), objective.nominal)
    shown = objective.summary(candidate)
    if output is not None:
        from metaid.show.figures import draw_episode

        with whole_file(output, FIGURE_SUFFIXES) as partial:
            draw_episode(objective, candidate, partial)
    if video is not None:
        filmed = {"candidate": objective.nominal.scaled(candidate), "true": objective.nominal}
        if study_name is not None:
            with open_store(storage) as store:
                filmed = api.candidates_of(store, study_name, objective)
        with whole_file(video, SUFFIXES, "--video") as partial:
            film(ChainStage(objective), filmed, partial)
    if as_json:
        print_json(shown)
        return
    what = (
        f"fell at step {shown['fall_step']} of {steps}"
        if shown["fell"]
        else f"{steps} steps without a fall; spectral {number_text(shown['spectral_hz'])} Hz"
    )
    rows = [
        [f"joint {i + 1}", str(count), number_text(hz)]
        for i, (count, hz) in enumerate(zip(shown["periods"], shown["frequency_hz"], strict=True))
    ]
    print_table(f"{shown['plant']}: {what}", ["joint", "whole periods", "frequency, Hz"], rows)
