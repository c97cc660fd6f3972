"""Which loop runs the episodes of a plant: the one place that asks what kind of robot it is."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

from metaid.compiled.faulty_loop import FaultyLoop
from metaid.compiled.loop import CompiledLoop
from metaid.compiled.quiet import quiet_mujoco
from metaid.compiled.sensed_loop import SensedLoop
from metaid.compiled.spatial.arm_loop import ArmLoop, QuickSpatial
from metaid.episode import Episode, Spatial, StepwiseLoop, run_stepwise, same_record
from metaid.plant import ArmPlant, MujocoPlant

CHECKED_STEPS = 25

ShortLoop = CompiledLoop | SensedLoop  # a compiled loop, which is first tried on a short episode
Loop = ShortLoop | StepwiseLoop


def _compiled_loop(plant: Any, episode: Episode) -> ShortLoop | None:
    """The compiled loop of a plant, which need not be right; None where it has none."""
    if isinstance(plant, ArmPlant):
        return ArmLoop(plant, episode)
    if not isinstance(plant, MujocoPlant):
        return None
    if plant.settings.faults.named or episode.lead or episode.readings_steps:
        return FaultyLoop(plant, episode)
    return CompiledLoop(plant, episode)


def fastest_loop(plant: Any, episode: Episode, law: Any) -> Loop:
    """The fastest loop that the plant has and that is right; it holds the plant's state, so one per thread.

    Model and data are reached by their addresses, which MuJoCo does not document. So a compiled loop is first compared
    with the stepwise one on a short episode with a `law`, the nominal one.
    """
    compiled = _compiled_loop(plant, episode)
    if compiled is None:
        if isinstance(episode.kind, Spatial):
            episode = replace(episode, kind=QuickSpatial(episode.kind.nominal))
        return StepwiseLoop(plant, episode)
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
