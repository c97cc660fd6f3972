"""Which loop runs the episodes of a plant: the one place that asks what kind of robot it is."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import singledispatch
from typing import Any, Protocol

from metaid.compiled.faulty_loop import FaultyLoop
from metaid.compiled.loop import CompiledLoop
from metaid.compiled.quiet import quiet_mujoco
from metaid.compiled.spatial.arm_loop import ArmLoop, QuickSpatial
from metaid.compiled.stages import fastest_step
from metaid.episode import Episode, GoesOn, Record, Spatial, StepwiseLoop, run_stepwise, same_record
from metaid.plant import ArmPlant, MujocoPlant

CHECKED_STEPS = 25


class Loop(Protocol):
    """What runs episodes on a plant: one at a time, or those of a batch that it shares with others of its kind."""

    plant: Any
    episode: Episode

    def run(self, law: Any, number: int = ..., goes_on: GoesOn | None = ..., /) -> Record: ...
    def new_batch(self, laws: Any, trials: Sequence[int], /) -> Any: ...
    def work_on(self, batch: Any) -> None: ...


class ShortLoop(Loop, Protocol):
    """A compiled loop, which is first tried on a short episode."""

    def on(self, episode: Episode) -> ShortLoop:
        """The same for another `episode`."""


@singledispatch
def compiled_loop(plant: Any, episode: Episode) -> ShortLoop | None:
    """The compiled loop of a plant, which need not be right; None where it has none."""
    return None


@compiled_loop.register
def _of_chain(plant: MujocoPlant, episode: Episode) -> ShortLoop:
    step = fastest_step(plant)
    if plant.settings.faults.named or episode.lead or episode.readings_steps:
        return FaultyLoop(plant, episode, step)
    return CompiledLoop(plant, episode, step)


@compiled_loop.register
def _of_arm(plant: ArmPlant, episode: Episode) -> ShortLoop:
    return ArmLoop(plant, episode)


@singledispatch
def quick_kind(kind: Any) -> Any:
    """A `kind` of robot, its law at its fastest."""
    return kind


@quick_kind.register
def _spatial(kind: Spatial) -> QuickSpatial:
    return QuickSpatial(kind.nominal)


def fastest_loop(plant: Any, episode: Episode, law: Any) -> Loop:
    """The fastest loop that the plant has and that is right.

    Model and data are reached by their addresses, which MuJoCo does not document. So a compiled loop is first compared
    with the stepwise one on a short episode.

    Args:
        plant: that is pushed; a loop holds its state, so one per thread.
        episode: what is done to it.
        law: the nominal one, by which loops are compared.
    """
    compiled = compiled_loop(plant, episode)
    if compiled is None:
        return StepwiseLoop(plant, replace(episode, kind=quick_kind(episode.kind)))
    if agrees_with_stepwise(compiled, law):
        return compiled
    warnings.warn(
        f"the compiled loop disagrees with the stepwise one on plant {plant.name}; using that, which is slow",
        stacklevel=3,
    )
    return StepwiseLoop(compiled.plant, compiled.episode)


def agrees_with_stepwise(loop: ShortLoop, law: Any, steps: int = CHECKED_STEPS) -> bool:
    """Whether a short episode comes out the same in a compiled and in the stepwise loop."""
    short = loop.on(loop.episode.shortened(steps))
    with quiet_mujoco():
        stepwise, _ = run_stepwise(short.plant, law, short.episode)
    return same_record(short.run(law), stepwise)
