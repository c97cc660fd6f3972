"""The plain loop as one that several workers can share a batch with, a whole episode at a time: for plants that the
compiled loop does not know.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from metaid.chain import Lumps
from metaid.episode import Episode, Record, run_plain
from metaid.errors import AbsentPlant, LostPlant
from metaid.plant import Plant

TRIES = 3  # of an episode in which the plant was lost


@dataclass(frozen=True)
class PlainBatch:
    """The `candidates`, lumps with a leading axis (ncandidate), a `queue` of their numbers, and what has been seen."""

    candidates: Lumps
    queue: Iterator[int]
    seen: dict[int, Record | LostPlant]

    def records(self) -> list[Record | LostPlant]:
        """What each candidate's episode showed, or how the plant was lost in it, once the queue is empty and every loop
        is back.
        """
        return [self.seen[candidate] for candidate in range(len(self.seen))]


class PlainEpisode:
    """An episode on any one plant, step by step in Python."""

    def __init__(self, plant: Plant, episode: Episode) -> None:
        self.plant = plant
        self.episode = episode

    def new_batch(self, candidates: Lumps) -> PlainBatch:
        """A batch of `candidates`, lumps with a leading axis (ncandidate), for this and its like to work on."""
        # `next` on such a queue is atomic, so each candidate goes to whoever is free first.
        return PlainBatch(candidates, iter(range(len(candidates.gravity))), {})

    def work_on(self, batch: PlainBatch) -> None:
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
                return run_plain(self.plant, candidate, self.episode)[0]
            except LostPlant as problem:
                tries += 1
                if tries == TRIES:
                    raise type(problem)(f"{problem}; the episode was tried {TRIES} times") from None
