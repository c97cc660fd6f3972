"""One episode of a plant, looked at: what is printed of it, how it is drawn, and how it is filmed.

A `Look` is that of a chain after a small push at the tip, or of an arm after a push from a pose in its ranges.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import click

from metaid import api
from metaid.cli.common import number_text
from metaid.compiled import ArmPush, Objective
from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant import ArmPlant, MujocoPlant
from metaid.study import COUNTING_STEPS, Problem

Table = tuple[str, list[str], list[list[str]]]  # its title, headings, and cells row by row


@dataclass
class ChainLook:
    """That of a chain: the episode of an `objective` with `factors` (nlump) of the plant's own lumps."""

    objective: Objective
    factors: Array

    @cached_property
    def shown(self) -> dict[str, Any]:
        """As `metaid episode --json` prints it."""
        return self.objective.summary(self.factors)

    @property
    def table(self) -> Table:
        """The same as a table."""
        shown, steps = self.shown, self.objective.episode.steps
        what = (
            f"fell at step {shown['fall_step']} of {steps}"
            if shown["fell"]
            else f"{steps} steps without a fall; spectral {number_text(shown['spectral_hz'])} Hz"
        )
        rows = [
            [f"joint {i + 1}", str(count), number_text(hz)]
            for i, (count, hz) in enumerate(zip(shown["periods"], shown["frequency_hz"], strict=True))
        ]
        return f"{shown['plant']}: {what}", ["joint", "whole periods", "frequency, Hz"], rows

    def draw(self, path: Path) -> None:
        """Draws it as a file whose ending says the format."""
        from metaid.show.figures import draw_episode  # loads matplotlib

        draw_episode(self.objective, self.factors, path)

    @property
    def laws(self) -> dict[str, Any]:
        """Laws that a film of it shows without a study, by the captions of its panels; none where it needs one."""
        own = self.objective.nominal
        return {"candidate": own.scaled(self.factors), "true": own}

    def stage(self, problem: Problem | None) -> Any:
        """Where the plant is filmed, under laws of the study of that `problem` if of any."""
        from metaid.show import ChainStage  # needs what films need

        return ChainStage(self.objective)


@dataclass
class ArmLook:
    """That of an arm: a `push` of a `plant`."""

    plant: ArmPlant
    push: ArmPush
    laws: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def shown(self) -> dict[str, Any]:
        return self.push.summary()

    @property
    def table(self) -> Table:
        shown = self.shown
        what = (
            f"fell after {shown['fall_time_s']:.3g} s, at step {shown['fall_step']} of {shown['steps']}"
            if shown["fell"]
            else f"{shown['steps']} steps without a fall; kinetic {number_text(shown['kinetic_hz'], '.3g')} Hz"
        )
        keys = "from", "to", "start_speed", "end_speed"
        rows = [
            [joint["name"], joint["does"], *(number_text(joint[key], ".4g") for key in keys)]
            for joint in shown["joints"]
        ]
        unit = "rad or m" if self.push.slides.any() else "rad"
        heading = ["joint", "it", f"from, {unit}", "to", "speed at the start, 1/s", "at the end"]
        return f"{self.push.plant}: {what}", heading, rows

    def draw(self, path: Path) -> None:
        from metaid.show.figures import draw_push  # loads matplotlib

        draw_push(self.push, path)

    def stage(self, problem: Problem | None) -> Any:
        from metaid.show import ArmStage  # needs what films need

        assert problem is not None, "an arm is filmed with a study"
        return ArmStage(self.plant, cast(Tree, problem.nominal))  # the study is about this arm


Look = ChainLook | ArmLook


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
        return ArmLook(plant, api.arm_push(plant, factors, steps, seed or 0, nominal))
    if given := [option for option, value in (("--seed", seed), ("--nominal", nominal)) if value is not None]:
        raise click.UsageError(f"{given[0]} is of an arm, and plant {plant.name} is a planar chain (allowed: --factor)")
    objective = api.episode_objective(plant, COUNTING_STEPS if steps is None else steps)
    return ChainLook(objective, api.check_factors(factors, objective.nominal))
