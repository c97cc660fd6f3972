"""Steps per second of the compiled episode, law, falls and crossings included, over bare `mj_step` on the same model.

Bare `mj_step` is compiled too, and the bindings' timer is off for it as it is for the episode. The plain Python loop is
the one that a rig would be run by. Arms have the law of a nominal arm, pushes as in a study, and the dry friction that
they have or none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numba import types

from benchmarks.common import NO_LIMIT, PLANTS, Row, interleaved, make_spec, run_alone
from metaid.compiled import CompiledLoop, Step, compiled, fastest_step, quiet_mujoco, step_of
from metaid.compiled.loop import start_states
from metaid.compiled.spatial import ArmLoop
from metaid.episode import Episode, FallRule, arm_episode, run_stepwise, window_ends
from metaid.models import Array
from metaid.models.tree import PriorDeviations
from metaid.plant import ArmPlant, load_plant
from metaid.plant.description import draw_starts
from metaid.study import Problem, drawn_nominal

ARMS = ("crs-a465", "puma560", "pa10")
HORIZON, STIFFNESS = 0.3, 30.0  # s, 1/s²
PLAIN_STEPS = 100  # of the plain loop, after each push

# Of MuJoCo's library, which metaid.pipeline has loaded.
mj_step: Any = types.ExternalFunction("mj_step", types.void(types.uintp, types.uintp))


@compiled
def bare(chain: Step, start: Array, steps: int) -> None:
    """`mj_step` and nothing else, after the same pushes, joint coordinates and speeds `start` (npush x 2 x njoint): the
    chain falls.
    """
    for push in range(start.shape[0]):
        for i in range(start.shape[2]):
            chain.qpos[i], chain.qvel[i], chain.torque[i] = start[push, 0, i], start[push, 1, i], 0.0
        for _ in range(steps):
            mj_step(chain.model, chain.data)


def measure(quick: bool) -> dict[str, list[Row]]:
    """One row a chain, and one an arm."""
    return {
        "Engine: steps per second on one core, and ratios to bare mj_step": [_row(n, quick) for n in PLANTS],
        "Arms: the same, by the fastest of 101 turns": [
            _arm_row(name, dry, quick) for name in ARMS for dry in (True, False)
        ],
    }


def _row(nlink: int, quick: bool) -> Row:
    problem = Problem(make_spec(nlink))
    plant, nominal, episode = problem.open_plant(), problem.nominal.lumps, problem.episode
    whole = step_of(plant.model, plant.data, is_direct=False)
    fastest = fastest_step(plant)
    assert fastest.is_direct, "MuJoCo's stages are not mj_step here: nothing to compare"
    steps: dict[str, Any] = {"mj_step": whole, "direct": fastest}
    engines = {name: CompiledLoop(plant, episode, step) for name, step in steps.items()}
    start = start_states(plant, episode.starts)
    short = Episode(episode.pushes, min(episode.steps, PLAIN_STEPS))
    run: dict[str, Callable[[], object]] = {
        "bare": lambda: bare(whole, start, episode.steps),
        **{name: partial(engine.run, nominal) for name, engine in engines.items()},
        "plain": lambda: run_stepwise(plant, nominal, short),
    }
    counts = {name: engine.run(nominal).total_steps for name, engine in engines.items()}
    counts |= {"bare": episode.total_steps, "plain": run_stepwise(plant, nominal, short)[0].total_steps}
    bare(whole, start, 1)
    plain = {"plain": run.pop("plain")}
    with quiet_mujoco():
        taken = interleaved(run, 5 if quick else 101)
    taken |= interleaved(plain, 2 if quick else 5)
    rate = {name: counts[name] / taken[name] for name in taken}
    return {
        "links": nlink,
        "bare mj_step": rate["bare"],
        "episode, mj_step": rate["mj_step"],
        "episode, direct (the default)": rate["direct"],
        "episode, plain Python": rate["plain"],
        "mj_step ÷ bare": rate["mj_step"] / rate["bare"],
        "direct ÷ bare": rate["direct"] / rate["bare"],
        "plain ÷ bare": rate["plain"] / rate["bare"],
    }


def _arm_row(name: str, dry: bool, quick: bool) -> Row:
    known = load_plant(name)
    assert isinstance(known, ArmPlant), name
    tree = known.tree if dry else replace(known.tree, coulomb=np.zeros(known.njoint))
    plant, nominal = ArmPlant(name, known.settings, tree), drawn_nominal(tree, 0, PriorDeviations())
    count, steps = 3 * plant.njoint, round(HORIZON / plant.timestep)
    stiffness = np.where(np.arange(count) < 2 * plant.njoint, 0.0, STIFFNESS)
    starts = draw_starts(known, count, HORIZON, 0)
    # Nothing is to fall, so that all pushes are of the same length.
    anywhere = replace(nominal, low=np.full(plant.njoint, -np.inf), high=np.full(plant.njoint, np.inf))
    watched = {"window_ends": window_ends(steps), "fall_rule": FallRule(runaway=NO_LIMIT)}
    episode = arm_episode(anywhere, starts, stiffness, steps, **watched)
    loop, whole = ArmLoop(plant, episode), step_of(plant.model, plant.data, is_direct=False)
    assert loop.run(nominal.parameters).total_steps == episode.total_steps
    works = {
        "bare": lambda: bare(whole, episode.states, steps),
        "episode": lambda: loop.run(nominal.parameters),
    }
    bare(whole, episode.states, 1)
    with quiet_mujoco():
        taken = interleaved(works, 5 if quick else 101, min)
    rate = {work: episode.total_steps / seconds for work, seconds in taken.items()}
    return {
        "arm": name,
        "joints": plant.njoint,
        "dry friction": "yes" if dry else "no",
        "bare mj_step": rate["bare"],
        "episode": rate["episode"],
        "episode ÷ bare": rate["episode"] / rate["bare"],
    }


if __name__ == "__main__":
    run_alone("engine", measure)
