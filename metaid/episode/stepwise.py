"""The episode step by step in Python, on any plant: the reference for the compiled loop, and what a rig uses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.episode.episode import Episode
from metaid.episode.plausible import PushCheck, StartCheck
from metaid.episode.readings import readings_before_fall
from metaid.episode.record import GoesOn, Record, Seen, States
from metaid.errors import AbsentPlant, ImplausiblePlant, LostPlant
from metaid.models import Array
from metaid.plant import FaultyPlant, Noise, SocketPlant, draw, stream

TRIES = 3  # of an episode in which the plant was lost
RESTING = 1000  # readings of the plant at rest, which tell how far noise alone can throw one
DEADBAND = 5.0  # of their standard deviation: a reading so near the upright tells no side


def noise_of(plant: FaultyPlant, episode: Episode, number: int) -> Noise:
    """The noise of an `episode` in the trial of that `number`: the same whenever, wherever, after whatever and with
    whatever candidate it is run.
    """
    return draw(plant.faults, stream(episode.seed, number), episode.npush, episode.steps, plant.njoint)


def with_deadband(episode: Episode, plant: FaultyPlant) -> Episode:
    """The `episode` in which noise about the upright is no crossing."""
    return replace(episode, deadband=DEADBAND * float(plant.rest(RESTING, episode.seed).std()))


@dataclass(frozen=True)
class CandidateBatch:
    """The `laws` of candidates, the numbers of their `trials`, a `queue` of their positions, and what has been `seen`:
    a batch for loops that run one whole episode after the other.
    """

    laws: Any
    trials: Sequence[int]
    queue: Iterator[int]
    seen: dict[int, Record | LostPlant]

    def records(self) -> list[Record | LostPlant]:
        """What each candidate's episode showed, or how the plant was lost in it, once the queue is empty and every loop
        is back.
        """
        return [self.seen[candidate] for candidate in range(len(self.seen))]


class WholeEpisodes:
    """A loop that runs one whole episode after the other on a `plant` of its own."""

    plant: Any
    episode: Episode

    def run(self, law: Any, number: int = 0, goes_on: GoesOn | None = None) -> Record:
        """The episode of the trial of that `number` with a `law`; `goes_on` is asked after each push but the last, as
        long as none fell.
        """
        raise NotImplementedError

    def new_batch(self, laws: Any, trials: Sequence[int]) -> CandidateBatch:
        """A batch of candidates with these `laws`, of the `trials` with these numbers, for this and its like to work
        on.
        """
        # `next` on such a queue is atomic, so each candidate goes to whoever is free first.
        return CandidateBatch(laws, trials, iter(range(len(trials))), {})

    def work_on(self, batch: CandidateBatch) -> None:
        """Runs episodes of the `batch` until there are none left; others may do so at the same time.  Raises
        AbsentPlant.
        """
        for candidate in batch.queue:
            try:
                batch.seen[candidate] = self.run(batch.laws[candidate], batch.trials[candidate])
            except AbsentPlant:
                raise  # nor is it there for the next
            except LostPlant as problem:
                batch.seen[candidate] = problem


class StepwiseLoop(WholeEpisodes):
    """An episode on any one plant, step by step in Python."""

    def __init__(self, plant: Any, episode: Episode) -> None:
        self.plant, self.episode = plant, episode
        self._earlier: dict[bytes, Array] = {}

    def run(self, law: Any, number: int = 0, goes_on: GoesOn | None = None) -> Record:
        """The same, again if the plant was lost in it. Raises LostPlant where that is of no help, ImplausiblePlant
        where its readings cannot be true, AbsentPlant where there is no plant any more.
        """
        tries = 0
        while True:
            try:
                return run_stepwise(self.plant, law, self.episode, number, self._earlier, goes_on)[0]
            except ImplausiblePlant:
                raise
            except LostPlant as problem:
                tries += 1
                if tries == TRIES:
                    raise type(problem)(f"{problem}; the episode was tried {TRIES} times") from None


def run_stepwise(
    plant: Any,
    law: Any,
    episode: Episode,
    number: int = 0,
    earlier: dict[bytes, Array] | None = None,
    goes_on: GoesOn | None = None,
) -> tuple[Record, States]:
    """One episode on any plant, step by step: the reference for the compiled loops, and what a rig uses.

    On a FaultyPlant what is returned is what its sensors read.

    Args:
        plant: that is pushed.
        law: what it is compensated with: lumps, or of an arm parameters (njoint x 13).
        episode: what is done to it.
        number: of the trial, whose noise a FaultyPlant has.
        earlier: what was seen in earlier episodes of a rig, as `PushCheck` has it; this one is added.
        goes_on: asked after each push but the last, as long as none fell; the plant is not pushed again where it says
            no.

    Raises:
        ImplausiblePlant: the readings of a rig that is calibrated cannot be true.
    """
    if isinstance(plant, FaultyPlant):
        plant.begin(noise_of(plant, episode, number))
    motions: list[States] = []
    fell = np.zeros(episode.npush, dtype=np.bool_)
    torques = episode.kind.torques(law, plant, episode)
    for push in range(episode.npush):
        check = None
        if episode.calibration is not None:
            check = episode.calibration.check(plant, push, {} if earlier is None else earlier)
        angles, speeds, fell[push] = _watch_push(plant, partial(torques, push), episode, push, check)
        motions.append(States(angles, speeds, plant.times if isinstance(plant, SocketPlant) else None))
        if fell[push] and episode.kind.ends_at_fall:
            break
        if goes_on is not None and push + 1 < episode.npush and not fell.any():
            so_far = record_of(motions, plant, episode, fell).first(push + 1)
            if not goes_on(so_far):
                return so_far, motions[-1]
    return record_of(motions, plant, episode, fell), motions[-1]


def record_of(
    motions: Sequence[States],
    plant: Any,
    episode: Episode,
    fell: NDArray[np.bool_],
    squares: Array | None = None,
) -> Record:
    """The record of an episode from what was seen of it.

    Args:
        motions: of each push that was begun.
        plant: that moved.
        episode: what was done to it.
        fell: which of all pushes did (npush).
        squares: as `Seen` has them.
    """
    record = episode.kind.record(Seen(motions, fell, plant.timestep, squares), episode)
    if not episode.readings_steps:
        return record
    reads_speeds = not isinstance(plant, FaultyPlant) or plant.faults.speed_sensor
    return replace(record, readings=readings_before_fall(motions, episode.readings_steps, fell, reads_speeds))


def _watch_push(
    plant: Any,
    torques: Callable[[Array, Array], Array],
    episode: Episode,
    push: int,
    check: PushCheck | StartCheck | None,
) -> tuple[Array, Array, bool]:
    """Joint angles and speeds (nsteps + 1 x njoint) after a `push` of an episode under the `torques` of a law, and
    whether it fell.  Raises ImplausiblePlant as the `check` of a rig does.

    However it ends, the torque is off then.
    """
    fallen = False
    try:
        plant.push(episode.starts[push])
        angles, speeds = plant.states()
        if check is not None:
            check.begin(angles, speeds)
        history = [(angles, speeds)]
        falls = episode.kind.falls(episode, speeds, plant.timestep)
        for _ in range(episode.steps):
            torque = torques(angles + episode.lead * speeds, speeds)
            plant.apply_torque(torque)
            plant.step()
            angles, speeds = plant.states()
            history.append((angles, speeds))
            if check is not None and np.isfinite(angles).all():  # a rig that has stopped itself shows nothing
                check.step(angles, speeds, torque)
            fallen = falls(angles, speeds)
            if fallen:
                break
        if check is not None:
            check.finish()
    finally:
        plant.stop()
    return np.array([angles for angles, _ in history]), np.array([speeds for _, speeds in history]), fallen
