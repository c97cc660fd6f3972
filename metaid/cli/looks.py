"""One episode of a plant, looked at: of a chain a push at the tip, of an arm one from a pose in its ranges."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import click

import metaid
from metaid import api, show
from metaid.compiled import ArmPush, Objective
from metaid.frames import number_text
from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant import ArmPlant, MujocoPlant
from metaid.study import Problem


@dataclass(frozen=True)
class Look:
    """What is to be seen of an episode.

    Attributes:
        shown: as `metaid episode --json` prints it.
        table: the same as title, headings, and cells row by row.
        draw: draws it as a file whose ending says the format.
        laws: that a film of it shows without a study, by the captions of its panels; none where it needs one.
        stage: where the plant is filmed, under laws of the study of a problem if of any.
    """

    shown: dict[str, Any]
    table: tuple[str, list[str], list[list[str]]]
    draw: Callable[[Path], None]
    laws: dict[str, Any]
    stage: Callable[[Problem | None], Any]


def look_at(
    plant: MujocoPlant | ArmPlant,
    factors: Mapping[str, float],
    steps: int | None,
    seed: int | None,
    nominal: int | None,
) -> Look:
    """An episode of a `plant`.

    Args:
        plant: that is pushed.
        factors: of what the law is made of, by name; 1 of what is not named.
        steps: after the push, or None for the usual number.
        seed: of where an arm begins.
        nominal: the seed of the nominal arm whose law is sent to an arm, or None for its own.
    """
    if not isinstance(plant, MujocoPlant):
        return _of_arm(plant, api.arm_push(plant, factors, steps, seed or 0, nominal))
    if given := [option for option, value in (("--seed", seed), ("--nominal", nominal)) if value is not None]:
        raise click.UsageError(f"{given[0]} is of an arm, and plant {plant.name} is a planar chain (allowed: --factor)")
    objective = api.episode_objective(plant, steps)
    return _of_chain(objective, api.check_factors(factors, objective.nominal))


def _of_chain(objective: Objective, factors: Array) -> Look:
    """The episode of an `objective` with `factors` (nlump) of the plant's own lumps."""
    shown, own = objective.summary(factors), objective.nominal
    what = (
        f"fell at step {shown['fall_step']} of {shown['steps']}"
        if shown["fell"]
        else f"{shown['steps']} steps without a fall; spectral {number_text(shown['spectral_hz'])} Hz"
    )
    rows = [
        [f"joint {i + 1}", str(count), number_text(hz)]
        for i, (count, hz) in enumerate(zip(shown["periods"], shown["frequency_hz"], strict=True))
    ]
    table = f"{shown['plant']}: {what}", ["joint", "whole periods", "frequency, Hz"], rows
    return Look(
        shown,
        table,
        draw=lambda path: metaid.figures.draw_episode(objective, factors, path),
        laws={"candidate": own.scaled(factors), "true": own},
        stage=lambda problem: show.ChainStage(objective),
    )


def _of_arm(plant: ArmPlant, push: ArmPush) -> Look:
    """A `push` of a `plant`."""

    def stage(problem: Problem | None) -> Any:
        assert problem is not None, "an arm is filmed with a study"
        return show.ArmStage(plant, cast(Tree, problem.nominal))  # the study is about this arm

    shown = push.summary()
    what = (
        f"fell after {shown['fall_time_s']:.3g} s, at step {shown['fall_step']} of {shown['steps']}"
        if shown["fell"]
        else f"{shown['steps']} steps without a fall; kinetic {number_text(shown['kinetic_hz'], '.3g')} Hz"
    )
    keys = "from", "to", "start_speed", "end_speed"
    rows = [
        [joint["name"], joint["does"], *(number_text(joint[key], ".4g") for key in keys)] for joint in shown["joints"]
    ]
    unit = "rad or m" if push.slides.any() else "rad"
    headings = ["joint", "it", f"from, {unit}", "to", "speed at the start, 1/s", "at the end"]
    table = f"{shown['plant']}: {what}", headings, rows
    return Look(shown, table, lambda path: metaid.figures.draw_push(push, path), {}, stage)
