"""Episodes on a simulated chain by the compiled loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from metaid.compiled.batch import Batch, laws_of
from metaid.compiled.kernel import run_from
from metaid.compiled.law import LINK
from metaid.compiled.queue import new_queue
from metaid.compiled.quiet import quiet_mujoco
from metaid.compiled.stages import Step, fastest_step
from metaid.episode import QUANTITIES, Episode, GoesOn, Record
from metaid.models import Array, Lumps
from metaid.plant import MujocoPlant, SimulatedPlant


def start_states(plant: SimulatedPlant, starts: Sequence[Any]) -> Array:
    """Joint coordinates and speeds (npush x 2 x njoint) right after the pushes that begin at `starts`."""
    return np.array([(plant.true_angles(start), plant.start_speeds(start)) for start in starts], dtype=np.float64)


class CompiledLoop:
    """An episode on one plant, compiled, by the given `step` or the fastest for MuJoCo; holds buffers, so one per
    thread.
    """

    def __init__(self, plant: MujocoPlant, episode: Episode, step: Step | None = None) -> None:
        self.plant = plant
        self.episode = episode
        self.step = fastest_step(plant) if step is None else step
        self._start = start_states(plant, episode.starts)
        ends = np.array(episode.window_ends, dtype=np.int64)
        self._settings = plant.timestep, episode.steps, *episode.fall_rule.clauses, ends
        self._links = np.zeros(plant.njoint, LINK)

    def new_batch(self, candidates: Lumps, _trials: Sequence[int] = ()) -> Batch:
        """A batch of `candidates`, lumps with a leading axis (ncandidate), for this and its like to work on. Nothing in
        it depends on the number of its trial.
        """
        episode = self.episode
        (npush, njoint), count = episode.pushes.shape, len(candidates.gravity)
        shape, in_windows = (count, npush, njoint), (count, npush, len(episode.window_ends))
        kept = (count, npush, episode.steps + 1, njoint) if episode.keep_angles else (0, 0, 0, 0)
        return Batch(
            episode,
            self.plant.timestep,
            laws_of(episode, self.plant.gravity, candidates),
            queue=new_queue(),
            ran=np.zeros((count, npush), dtype=np.int64),
            fell=np.zeros((count, npush), dtype=np.bool_),
            outputs=(np.zeros(shape, dtype=np.int64), np.zeros(shape), np.zeros(shape), np.zeros(shape)),
            windows=(np.zeros((*in_windows, QUANTITIES, njoint)), np.zeros((*in_windows, njoint), dtype=np.int64)),
            angles=np.zeros(kept),
        )

    def work_on(self, batch: Batch) -> None:
        """Runs pushes of the `batch` until there are none left; others may do so at the same time."""
        results = batch.ran, batch.fell, batch.outputs, batch.windows, batch.angles
        with quiet_mujoco():
            run_from(self.step, self._start, batch.queue, batch.laws, self._settings, self._links, *results)

    def run(self, law: Any, _number: int = 0, goes_on: GoesOn | None = None) -> Record:
        """One episode with a `law`, lumps; `goes_on` is asked after each push."""
        batch = self.new_batch(law[None])
        self.work_on(batch)
        return batch.records()[0].stopped_early(goes_on)

    def on(self, episode: Episode) -> CompiledLoop:
        """The same for another `episode`."""
        return CompiledLoop(self.plant, episode, self.step)
