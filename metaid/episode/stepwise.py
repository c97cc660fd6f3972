"""The episode step by step in Python, on any plant: the reference for the compiled loop, and what a rig uses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from metaid.episode.episode import Episode
from metaid.episode.noise import noise_of
from metaid.episode.plausible import PushCheck
from metaid.episode.readings import readings_before_fall, told_times
from metaid.episode.record import GoesOn, Record, Trajectory, crosses_at, crossings, energies, stopped, windows_of
from metaid.errors import AbsentPlant, ImplausiblePlant, LostPlant
from metaid.models import Array, ChainModel, Lumps
from metaid.plant import FaultyPlant, Plant, SocketPlant

TRIES = 3  # of an episode in which the plant was lost
Seen = TypeVar("Seen")


@dataclass(frozen=True)
class CandidateBatch:
    """The `candidates`, lumps with a leading axis (ncandidate), the numbers of their `trials`, a `queue` of their
    positions, and what has been `seen`: a batch for loops that run one whole episode after the other.
    """

    candidates: Lumps
    trials: Sequence[int]
    queue: Iterator[int]
    seen: dict[int, Record | LostPlant]

    def records(self) -> list[Record | LostPlant]:
        """What each candidate's episode showed, or how the plant was lost in it, once the queue is empty and every loop
        is back.
        """
        return [self.seen[candidate] for candidate in range(len(self.seen))]

    def work_through(self, run: Callable[[Lumps, int], Record]) -> None:
        """Runs episodes until there are none left; others may do so at the same time.  Raises AbsentPlant."""
        for candidate in self.queue:
            try:
                self.seen[candidate] = run(self.candidates[candidate], self.trials[candidate])
            except AbsentPlant:
                raise  # nor is it there for the next
            except LostPlant as problem:
                self.seen[candidate] = problem


def new_candidate_batch(candidates: Lumps, trials: Sequence[int]) -> CandidateBatch:
    """A batch of `candidates`, lumps with a leading axis (ncandidate), of the `trials` with these numbers, of which
    nothing has been run.
    """
    # `next` on such a queue is atomic, so each candidate goes to whoever is free first.
    return CandidateBatch(candidates, trials, iter(range(len(candidates.gravity))), {})


class StepwiseLoop:
    """An episode on any one plant, step by step in Python."""

    def __init__(self, plant: Plant, episode: Episode) -> None:
        self.plant = plant
        self.episode = episode
        self._earlier: dict[bytes, Array] = {}

    def new_batch(self, candidates: Lumps, trials: Sequence[int]) -> CandidateBatch:
        """A batch of `candidates`, lumps with a leading axis (ncandidate), of the `trials` with these numbers, for this
        and its like to work on.
        """
        return new_candidate_batch(candidates, trials)

    def work_on(self, batch: CandidateBatch) -> None:
        """Runs episodes of the `batch` until there are none left; others may do so at the same time.  Raises
        AbsentPlant.
        """
        batch.work_through(self.run)

    def run(self, candidate: Lumps, number: int = 0, goes_on: GoesOn | None = None) -> Record:
        """The episode of the trial of that `number` with the `candidate` lumps, again if the plant was lost in it;
        `goes_on` is asked after each push. Raises LostPlant where that is of no help, ImplausiblePlant where its
        readings cannot be true, AbsentPlant where there is no plant any more.
        """
        return again_if_lost(
            lambda: run_stepwise(self.plant, candidate, self.episode, number, self._earlier, goes_on)[0]
        )


def again_if_lost(run: Callable[[], Seen]) -> Seen:
    """What an episode shows that is `run` again, TRIES times in all, if the plant was lost in it. Raises LostPlant
    where that is of no help, ImplausiblePlant where its readings cannot be true, AbsentPlant where there is no plant
    any more.
    """
    tries = 0
    while True:
        try:
            return run()
        except ImplausiblePlant:
            raise
        except LostPlant as problem:
            tries += 1
            if tries == TRIES:
                raise type(problem)(f"{problem}; the episode was tried {TRIES} times") from None


def run_stepwise(
    plant: Plant,
    candidate: Lumps,
    episode: Episode,
    number: int = 0,
    earlier: dict[bytes, Array] | None = None,
    goes_on: GoesOn | None = None,
) -> tuple[Record, Trajectory]:
    """One episode on any plant, step by step: the reference for the compiled loops, and what a rig uses.

    On a FaultyPlant what is returned is what its sensors read.

    Args:
        plant: that is pushed.
        candidate: the lumps that it is compensated with.
        episode: what is done to it.
        number: of the trial, whose noise a FaultyPlant has.
        earlier: what was seen in earlier episodes of a rig, as `PushCheck` has it; this one is added.
        goes_on: asked after each push but the last, unless a link fell; the plant is not pushed again where it says no.

    Raises:
        ImplausiblePlant: the readings of a rig that is calibrated cannot be true.
    """
    if isinstance(plant, FaultyPlant):
        plant.begin(noise_of(plant, episode, number))
    law = ChainModel(candidate, plant.gravity, episode.stiffness)
    motions: list[tuple[Array, Array]] = []
    times: list[Array | None] = []
    for push in range(len(episode.pushes)):
        angles, speeds, fallen = _watch_push(plant, law, episode, push, {} if earlier is None else earlier)
        motions.append((angles, speeds))
        times.append(plant.times if isinstance(plant, SocketPlant) else None)
        if fallen:
            break
        if goes_on is not None and push + 1 < len(episode.pushes):
            so_far = stopped(_record_of(motions, times, plant, episode, fallen), episode, push + 1)
            if not goes_on(so_far):
                return so_far, Trajectory(angles, speeds)
    return _record_of(motions, times, plant, episode, fallen), Trajectory(angles, speeds)


def _record_of(
    motions: Sequence[tuple[Array, Array]], times: Sequence[Array | None], plant: Plant, episode: Episode, fell: bool
) -> Record:
    """The record of an episode from the joint angles and speeds (nsteps + 1 x njoint) of each push that was begun, and
    the times of its readings (nsteps + 1), in s, where the plant tells them.
    """
    shape = episode.pushes.shape
    half_periods, span = np.zeros(shape, dtype=np.int64), np.zeros(shape)
    speed_energy, acceleration_energy = np.zeros(shape), np.zeros(shape)
    for push, ((angles, speeds), start) in enumerate(zip(motions, episode.starts, strict=False)):
        half_periods[push], span[push] = crossings(
            angles, crosses_at(start, speeds[0]), plant.timestep, episode.deadband
        )
        wanted = -episode.stiffness * angles[:-1]
        speed_energy[push], acceleration_energy[push] = energies(speeds, plant.timestep, wanted)
    steps = sum(len(angles) - 1 for angles, _ in motions)
    seen = half_periods, span, speed_energy, acceleration_energy
    kept = tuple(angles for angles, _ in motions) if episode.keep_angles else ()
    windows = windows_of(motions, episode, plant.timestep, fell)
    readings = None
    if episode.readings_steps:
        reads_speeds = not isinstance(plant, FaultyPlant) or plant.faults.speed_sensor
        readings = readings_before_fall(motions, len(episode.pushes), episode.readings_steps, fell, reads_speeds)
        readings = told_times(times, readings)
    fall_step = steps if fell else None
    return Record(plant.timestep, steps, fall_step, *seen, kept, episode.noise_floor.energy, windows, readings)


def _watch_push(
    plant: Plant, law: ChainModel, episode: Episode, push: int, earlier: dict[bytes, Array]
) -> tuple[Array, Array, bool]:
    """Joint angles and speeds (nsteps + 1 x njoint) after a `push` of an episode under the torque of a `law`, and
    whether a link fell.  Raises ImplausiblePlant.

    However it ends, the torque is off then.
    """
    rule, fallen, check = episode.fall_rule, False, None
    if episode.calibration is not None:
        check = PushCheck(plant.name, episode.calibration, push, plant.timestep, earlier)
    try:
        plant.push(episode.starts[push])
        angles, speeds = plant.states()
        if check is not None:
            check.begin(angles, speeds)
        history = [(angles, speeds)]
        allowed = rule.allowed_speeds(np.cumsum(speeds))
        for _ in range(episode.steps):
            torque = law.torque(angles + episode.lead * speeds, speeds)
            plant.apply_torque(torque)
            plant.step()
            angles, speeds = plant.states()
            history.append((angles, speeds))
            if check is not None and np.isfinite(angles).all():  # a rig that has stopped itself shows nothing
                check.step(angles, speeds, torque)
            fallen = rule.has_fallen(np.cumsum(angles), np.cumsum(speeds), allowed, plant.timestep)
            if fallen:
                break
        if check is not None:
            check.finish()
    finally:
        plant.stop()
    return np.array([angles for angles, _ in history]), np.array([speeds for _, speeds in history]), fallen
