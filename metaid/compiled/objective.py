"""One candidate, one episode by the fastest loop that the plant has, one outcome, whatever the kind of robot.

It knows neither samplers nor storage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from metaid.compiled.fastest import fastest_loop
from metaid.compiled.quiet import quiet_mujoco
from metaid.episode import (
    Episode,
    GoesOn,
    Outcome,
    Record,
    States,
    crossing_hz,
    failure,
    fall_value,
    get_measure,
    run_stepwise,
    spectral_hz,
)
from metaid.errors import EpisodeError, LostPlant
from metaid.models import Array, Lumps
from metaid.models.tree import ArmPrior


class Objective:
    """Evaluates candidates on a plant by a measure. Holds the plant's state, so one per worker.

    The noise of a plant with faults is drawn from the episode's seed and the `number` of the trial. Where none is given
    it is that of trial 0: candidates that are evaluated one by one all have the same noise.

    Args:
        plant: that candidates are tried on.
        nominal: what candidates differ from: lumps, whose factors they are, or the prior of an arm, whose base
            parameters they are.
        episode: what is done to the plant with each candidate.
        measure: a key of `MEASURES`.
        rule: the counting rule of the measure `count`; None for its usual one.

    Raises:
        EpisodeError: plant, nominal model and pushes differ in their number of joints, or no measure has that name
            and that rule.
    """

    def __init__(
        self, plant: Any, nominal: Lumps | ArmPrior, episode: Episode, measure: str, rule: str | None = None
    ) -> None:
        if not nominal.njoint == plant.njoint == episode.njoint:
            raise EpisodeError(
                f"plant {plant.name} has {plant.njoint} joints, the nominal model {nominal.njoint}, "
                f"the pushes {episode.njoint}: they must agree"
            )
        self.plant = plant
        self.nominal: Any = nominal
        self.measure = get_measure(measure, rule, episode.kind)
        self.episode = episode = replace(episode, keep_angles=episode.keep_angles or self.measure.keeps_angles)
        self._loop = fastest_loop(plant, episode, nominal.law)
        self._ceiling = self.measure.ceiling(episode, self._loop.plant.timestep)

    def record(self, candidate: Array, number: int = 0, goes_on: GoesOn | None = None) -> Record:
        """What the episode of a `candidate` (nsearched) shows in the trial of that `number`, as long as it `goes_on`.
        Raises EpisodeError where it is none, LostPlant and AbsentPlant.
        """
        return self._loop.run(self.nominal.law_of(candidate), number, goes_on)

    def watch(self, candidate: Array, number: int = 0) -> tuple[Record, States]:
        """The same, and the motion after the last push, step by step in Python."""
        with quiet_mujoco():
            return run_stepwise(self._loop.plant, self.nominal.law_of(candidate), self._loop.episode, number)

    def close(self) -> None:
        """Lets go of the plant."""
        self.plant.close()

    def evaluate(self, candidate: Array, number: int = 0, goes_on: GoesOn | None = None) -> Outcome:
        """The outcome for a `candidate` (nsearched) in the trial of that `number`. After each push but the last, as
        long as none fell, `goes_on` is asked; where it says no, the outcome is of the pushes so far.  Raises as
        `record` does.
        """
        return self._outcome(self.record(candidate, number, goes_on))

    def value(self, record: Record) -> float:
        """The measure of what pushes that did not fall showed."""
        return self.measure.value(record, self.episode)

    def share(self, candidates: Array, trials: Sequence[int]) -> Any:
        """A batch of `candidates` (ncandidate x nsearched), of the `trials` with these numbers (ncandidate), for this
        objective and its like, each on a thread of its own, to work on.
        """
        return self._loop.new_batch(self.nominal.laws_of(candidates), trials)

    def work_on(self, batch: Any) -> None:
        """Runs episodes of the `batch` until there are none left; others may do so at the same time."""
        self._loop.work_on(batch)

    def outcomes(self, batch: Any) -> list[Outcome]:
        """The outcomes of a `batch`'s candidates (ncandidate), once everyone is back from it: a failure where the plant
        was lost in every try.
        """
        return [self._outcome(record) for record in batch.records()]

    def _outcome(self, record: Record | LostPlant) -> Outcome:
        if isinstance(record, LostPlant):
            return failure(self.measure, self.episode, self._loop.plant.timestep, str(record))
        fell, steps = record.fall_step is not None, record.total_steps
        value = fall_value(self._ceiling, steps, self.episode.total_steps) if fell else self.value(record)
        periods = tuple(self.measure.periods(record).tolist())
        return Outcome(value, fell, steps, periods, windows=record.windows, readings=record.readings)

    def summary(self, candidate: Array) -> dict[str, Any]:
        """One episode of a chain as the fields that `metaid episode --json` prints; frequencies are None for a fall."""
        record = self.record(candidate)
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
