"""Episodes on a simulated plant by the compiled loop.

Model and data are reached by their addresses, which MuJoCo does not promise; `CompiledLoop.agrees_with_stepwise`
compares the two loops on a short episode before anything is believed.
"""

from __future__ import annotations

import functools

import mujoco
import numpy as np
from numba import cfunc

from metaid.compiled.analytic import analytic_step
from metaid.compiled.batch import Batch, new_batch
from metaid.compiled.kernel import Step, run_from
from metaid.compiled.law import LINK
from metaid.compiled.stages import agrees_with_mj_step, direct_step, mujoco_step
from metaid.episode import Episode, Record, run_stepwise, same_record, window_ends
from metaid.models import Lumps
from metaid.plant import MujocoPlant


@cfunc("float64()")
def _no_time() -> float:
    return 0.0


@cfunc("void(uintp)")
def _no_warning(_message: int) -> None:
    return


@functools.cache
def _quiet_mujoco() -> None:
    """Takes out the bindings' timer, half of all the time at three links, and the log file of warnings: a diverged
    episode is a fall.
    """
    mujoco.set_mjcb_time(_no_time.ctypes)
    mujoco.set_mju_user_warning(_no_warning.ctypes)


def fastest_step(plant: MujocoPlant, physics: str = "mujoco") -> Step:
    """How the compiled loop moves `plant` on: its analytic equations, or MuJoCo's stages one by one, or `mj_step` where
    these are not the same to the last bit.
    """
    _quiet_mujoco()
    if physics == "analytic":
        return analytic_step(plant.chain, plant.felt_gravity, plant.timestep)
    make = direct_step if agrees_with_mj_step(plant.model, plant.data) else mujoco_step
    return make(plant.model, plant.data)


class CompiledLoop:
    """An episode on one plant, compiled, by the given `step` or the fastest for MuJoCo; holds buffers, so one per
    thread.
    """

    def __init__(self, plant: MujocoPlant, episode: Episode, step: Step | None = None) -> None:
        _quiet_mujoco()
        self.plant = plant
        self.episode = episode
        self.step = fastest_step(plant) if step is None else step
        self._start = np.array([plant.start_speeds(impulses) for impulses in episode.pushes])
        ends = np.array(episode.window_ends, dtype=np.int64)
        self._settings = plant.timestep, episode.steps, episode.fall_limit, episode.fall_margin, ends
        self._links = np.zeros(plant.njoint, LINK)

    def new_batch(self, candidates: Lumps) -> Batch:
        """A batch of `candidates`, lumps with a leading axis (ncandidate), for this and its like to work on."""
        return new_batch(self.episode, self.plant.timestep, self.plant.gravity, candidates)

    def work_on(self, batch: Batch) -> None:
        """Runs pushes of the `batch` until there are none left; others may do so at the same time."""
        results = batch.ran, batch.fell, batch.outputs, batch.windows, batch.angles
        run_from(self.step, self._start, batch.queue, batch.laws, self._settings, self._links, *results)

    def run(self, candidate: Lumps) -> Record:
        """One episode with the `candidate` lumps."""
        batch = self.new_batch(candidate[None])
        self.work_on(batch)
        return batch.records()[0]

    def agrees_with_stepwise(self, candidate: Lumps, steps: int = 25) -> bool:
        """Whether a short episode comes out the same in the compiled and in the plain loop."""
        short = Episode(
            self.episode.pushes[:1],
            min(steps, self.episode.steps),
            self.episode.fall_limit,
            self.episode.fall_margin,
            stiffness=self.episode.stiffness,
            window_ends=window_ends(min(steps, self.episode.steps)),
        )
        compiled = CompiledLoop(self.plant, short, self.step).run(candidate)
        plain, _ = run_stepwise(self.plant, candidate, short)
        return same_record(compiled, plain)
