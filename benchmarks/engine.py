"""Steps per second of the compiled episode, law, falls and crossings included, over bare `mj_step` on the same model.

Bare `mj_step` is compiled too, and the bindings' timer is off for it as it is for the episode. The plain Python loop is
the one that a rig would be run by.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numba import types

from benchmarks.common import PLANTS, Row, interleaved, make_spec, run_alone
from metaid.compiled import CompiledLoop, DirectStep, MujocoStep, compiled, fastest_step, mujoco_step, quiet_mujoco
from metaid.episode import Episode, run_stepwise
from metaid.models import Array
from metaid.study import Problem

PLAIN_STEPS = 100  # of the plain loop, after each push

# Of MuJoCo's library, which metaid.pipeline has loaded.
mj_step: Any = types.ExternalFunction("mj_step", types.void(types.uintp, types.uintp))


@compiled
def bare(chain: MujocoStep, start: Array, steps: int) -> None:
    """`mj_step` and nothing else, after the same pushes, joint speeds `start` (npush x njoint): the chain falls."""
    for push in range(start.shape[0]):
        for i in range(start.shape[1]):
            chain.qpos[i], chain.qvel[i], chain.torque[i] = 0.0, start[push, i], 0.0
        for _ in range(steps):
            mj_step(chain.model, chain.data)


def measure(quick: bool) -> dict[str, list[Row]]:
    """One row a chain."""
    return {"Engine: steps per second on one core, and ratios to bare mj_step": [_row(n, quick) for n in PLANTS]}


def _row(nlink: int, quick: bool) -> Row:
    problem = Problem(make_spec(nlink))
    plant, nominal, episode = problem.make_plant(), problem.nominal.lumps, problem.episode
    whole = mujoco_step(plant.model, plant.data)
    fastest = fastest_step(plant)
    assert isinstance(fastest, DirectStep), "MuJoCo's stages are not mj_step here: nothing to compare"
    steps: dict[str, Any] = {"mj_step": whole, "direct": fastest, "analytic": fastest_step(plant, "analytic")}
    engines = {name: CompiledLoop(plant, episode, step) for name, step in steps.items()}
    start = np.array([plant.start_speeds(start) for start in episode.starts])
    short = Episode(episode.pushes, min(episode.steps, PLAIN_STEPS))
    run: dict[str, Callable[[], object]] = {
        "bare": lambda: bare(whole, start, episode.steps),
        **{name: partial(engine.run, nominal) for name, engine in engines.items()},
        "plain": lambda: run_stepwise(plant, nominal, short),
    }
    counts = {name: engine.run(nominal).steps for name, engine in engines.items()}
    counts |= {"bare": episode.total_steps, "plain": run_stepwise(plant, nominal, short)[0].steps}
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
        "episode, analytic": rate["analytic"],
        "episode, plain Python": rate["plain"],
        "mj_step ÷ bare": rate["mj_step"] / rate["bare"],
        "direct ÷ bare": rate["direct"] / rate["bare"],
        "analytic ÷ bare": rate["analytic"] / rate["bare"],
        "plain ÷ bare": rate["plain"] / rate["bare"],
    }


if __name__ == "__main__":
    run_alone("engine", measure)
