"""The episode step by step in Python, on any plant: the reference for the compiled loop, and what a rig uses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from metaid.episode.episode import Episode
from metaid.episode.falls import has_fallen
from metaid.episode.record import Record, Trajectory, crossings, energies, windows_of
from metaid.errors import AbsentPlant, LostPlant
from metaid.models import Array, Lumps, compensation_torque
from metaid.plant import Plant

TRIES = 3  # of an episode in which the plant was lost


@dataclass(frozen=True)
class StepwiseBatch:
    """The `candidates`, lumps with a leading axis (ncandidate), a `queue` of their numbers, and what has been seen."""

    candidates: Lumps
    queue: Iterator[int]
    seen: dict[int, Record | LostPlant]

    def records(self) -> list[Record | LostPlant]:
        """What each candidate's episode showed, or how the plant was lost in it, once the queue is empty and every loop
        is back.
        """
        return [self.seen[candidate] for candidate in range(len(self.seen))]


class StepwiseLoop:
    """An episode on any one plant, step by step in Python."""

    def __init__(self, plant: Plant, episode: Episode) -> None:
        self.plant = plant
        self.episode = episode

    def new_batch(self, candidates: Lumps) -> StepwiseBatch:
        """A batch of `candidates`, lumps with a leading axis (ncandidate), for this and its like to work on."""
        # `next` on such a queue is atomic, so each candidate goes to whoever is free first.
        return StepwiseBatch(candidates, iter(range(len(candidates.gravity))), {})

    def work_on(self, batch: StepwiseBatch) -> None:
        """Runs episodes of the `batch` until there are none left; others may do so at the same time.  Raises
        AbsentPlant.
        """
        for candidate in batch.queue:
            try:
                batch.seen[candidate] = self.run(batch.candidates[candidate])
            except AbsentPlant:
                raise  # nor is it there for the next
            except LostPlant as problem:
                batch.seen[candidate] = problem

    def run(self, candidate: Lumps) -> Record:
        """One episode with the `candidate` lumps, again if the plant was lost in it.  Raises LostPlant where that is of
        no help, AbsentPlant where there is no plant any more.
        """
        tries = 0
        while True:
            try:
                return run_stepwise(self.plant, candidate, self.episode)[0]
            except LostPlant as problem:
                tries += 1
                if tries == TRIES:
                    raise type(problem)(f"{problem}; the episode was tried {TRIES} times") from None


def run_stepwise(plant: Plant, candidate: Lumps, episode: Episode) -> tuple[Record, Trajectory]:
    """One episode on any plant, step by step: the reference for the compiled loop, and what a rig uses."""
    shape = episode.pushes.shape
    half_periods, span = np.zeros(shape, dtype=np.int64), np.zeros(shape)
    speed_energy, acceleration_energy = np.zeros(shape), np.zeros(shape)
    steps, fall_step, motions = 0, None, []
    for push, impulses in enumerate(episode.pushes):
        angles, speeds = _watch_push(plant, candidate, episode, impulses)
        ran = len(angles) - 1
        motions.append((angles, speeds))
        half_periods[push], span[push] = crossings(angles, speeds[0], plant.timestep, episode.deadband)
        asked = -episode.stiffness * angles[:-1]
        speed_energy[push], acceleration_energy[push] = energies(speeds, plant.timestep, asked)
        steps += ran
        fastest = episode.fall_margin * np.abs(np.cumsum(speeds[0])).max()
        if has_fallen(np.cumsum(angles[-1]), np.cumsum(speeds[-1]), episode.fall_limit, fastest):
            fall_step = steps
            break
    seen = half_periods, span, speed_energy, acceleration_energy
    kept = tuple(angles for angles, _ in motions) if episode.keep_angles else ()
    windows = windows_of(motions, episode, plant.timestep, fall_step is not None)
    record = Record(plant.timestep, steps, fall_step, *seen, kept, episode.noise_floor.energy, windows)
    return record, Trajectory(angles, speeds)


def _watch_push(plant: Plant, candidate: Lumps, episode: Episode, impulses: Array) -> tuple[Array, Array]:
    """Joint angles and speeds (nsteps + 1 x njoint) after a push; however it ends, the torque is off then."""
    try:
        plant.push(impulses)
        angles, speeds = plant.states()
        history = [(angles, speeds)]
        fastest = episode.fall_margin * np.abs(np.cumsum(speeds)).max()
        for _ in range(episode.steps):
            led = angles + episode.lead * speeds
            plant.apply_torque(compensation_torque(candidate, led, speeds, plant.gravity, episode.stiffness))
            plant.step()
            angles, speeds = plant.states()
            history.append((angles, speeds))
            if has_fallen(np.cumsum(angles), np.cumsum(speeds), episode.fall_limit, fastest):
                break
    finally:
        plant.stop()
    return np.array([angles for angles, _ in history]), np.array([speeds for _, speeds in history])
