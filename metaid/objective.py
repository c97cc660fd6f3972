"""One candidate, one perturb-and-count episode, one outcome. Knows neither samplers nor storage nor who asks."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

from metaid.chain import Array, Lumps
from metaid.episode import Episode, Record, run_plain
from metaid.errors import EpisodeError, LostPlant
from metaid.kernel import CompiledEpisode, fastest_step
from metaid.measures import crossing_hz, fall_value, get_measure, spectral_hz
from metaid.plant import MujocoPlant, Plant
from metaid.queue import Queue, take

TRIES = 3  # of an episode in which the plant was lost


@dataclass(frozen=True)
class Outcome:
    """What became of a candidate: its `value` in the measure's unit (for a fall, one above every survivor's), steps
    run, periods per joint.

    One that could not be evaluated has the `failure` that says why, and for the searcher is a fall before the first
    step, so worse than any that was seen.
    """

    value: float
    fell: bool
    steps: int
    periods: tuple[int, ...]
    failure: str | None = None


class Objective:
    """Evaluates factors of `nominal` lumps on a `plant` by a `measure`, `count` with a counting `rule`. Holds the
    plant's state, so one per worker.

    `physics` is "mujoco", or "analytic" for a MujocoPlant's own equations of motion.
    """

    def __init__(
        self,
        plant: Plant,
        nominal: Lumps,
        episode: Episode,
        measure: str,
        physics: str = "mujoco",
        rule: str | None = None,
    ) -> None:
        if nominal.nlink != plant.njoint or episode.pushes.shape[1] != plant.njoint:
            raise EpisodeError(
                f"plant {plant.name} has {plant.njoint} joints, the nominal model {nominal.nlink}, "
                f"the pushes {episode.pushes.shape[1]}: they must agree"
            )
        self.plant = plant
        self.nominal = nominal
        self.measure = get_measure(measure, rule)
        self.episode = episode = replace(episode, keep_angles=episode.keep_angles or self.measure.keeps_angles)
        self._ceiling = self.measure.ceiling(episode, plant.timestep)
        self._compiled = _compiled_loop(plant, nominal, episode, physics)

    def record(self, factors: Array) -> Record:
        """What the episode of a candidate with these `factors` (nlump) shows.

        An episode in which the plant was lost is run again.  Raises LostPlant where that is of no help.
        """
        candidate = self.nominal.scaled(factors)
        if self._compiled is not None:
            return self._compiled.run(candidate)
        tries = 0
        while True:
            try:
                return run_plain(self.plant, candidate, self.episode)[0]
            except LostPlant as problem:
                tries += 1
                if tries == TRIES:
                    raise LostPlant(f"{problem}; the episode was tried {TRIES} times") from None

    def close(self) -> None:
        """Lets go of the plant."""
        self.plant.close()

    def evaluate(self, factors: Array) -> Outcome:
        """The outcome for `factors` (nlump) of the nominal lumps."""
        return self._outcome(self.record(factors))

    def evaluate_from(self, queue: Queue, batch: Array) -> dict[int, Outcome]:
        """The outcomes of those rows of the `batch` (ncandidate x nlump) that are taken here from a `queue` which
        several objectives share, by row.
        """
        if self._compiled is not None:
            records = self._compiled.run_from(queue, self.nominal.scaled(batch))
            return {candidate: self._outcome(record) for candidate, record in records}
        found = {}
        while (candidate := take(queue)) < len(batch):
            found[candidate] = self.evaluate(batch[candidate])
        return found

    def _outcome(self, record: Record) -> Outcome:
        fell = record.fall_step is not None
        value = (
            fall_value(self._ceiling, record.steps, self.episode.total_steps) if fell else self.measure.value(record)
        )
        return Outcome(value, fell, record.steps, tuple(self.measure.periods(record).tolist()))

    def summary(self, factors: Array) -> dict[str, Any]:
        """One episode as the fields that `metaid episode --json` prints; frequencies are None for a fall."""
        record = self.record(factors)
        fell = record.fall_step is not None
        frequency = crossing_hz(record.half_periods, record.crossing_span).mean(axis=0)
        return {
            "plant": self.plant.name,
            "steps": self.episode.total_steps,
            "fell": fell,
            "fall_step": record.fall_step,
            "periods": self.measure.periods(record).tolist(),
            "frequency_hz": [None if fell else hz for hz in frequency.tolist()],
            "spectral_hz": None if fell else spectral_hz(record.acceleration_energy, record.speed_energy),
        }


def _compiled_loop(plant: Plant, nominal: Lumps, episode: Episode, physics: str) -> CompiledEpisode | None:
    if not isinstance(plant, MujocoPlant):
        return None
    compiled = CompiledEpisode(plant, episode, fastest_step(plant, physics))
    if compiled.agrees_with_plain(nominal):
        return compiled
    warnings.warn(
        f"the compiled loop disagrees with the plain one on plant {plant.name}; using the plain one, which is slow",
        stacklevel=3,
    )
    return None
