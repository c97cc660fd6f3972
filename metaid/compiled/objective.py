"""One candidate, one episode by the fastest loop that the plant has, one outcome.

It knows neither samplers nor storage.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from metaid.compiled.faulty_loop import FaultyLoop
from metaid.compiled.loop import CompiledLoop, fastest_step
from metaid.compiled.quiet import quiet_mujoco
from metaid.episode import (
    Episode,
    GoesOn,
    Outcome,
    Record,
    StepwiseLoop,
    Trajectory,
    crossing_hz,
    failure,
    fall_value,
    get_measure,
    run_stepwise,
    spectral_hz,
)
from metaid.errors import EpisodeError, LostPlant
from metaid.models import Array, Lumps
from metaid.plant import MujocoPlant, Plant

LARGEST_FACTOR = 1000.0


class Loop(Protocol):
    """What runs episodes on a plant: one at a time, or those of a batch that it shares with others of its kind."""

    plant: Any
    episode: Episode

    def run(self, candidate: Lumps, number: int = ..., goes_on: GoesOn | None = ..., /) -> Record: ...
    def new_batch(self, candidates: Lumps, trials: Sequence[int], /) -> Any: ...
    def work_on(self, batch: Any) -> None: ...


class Objective:
    """Evaluates factors of nominal lumps on a plant by a measure. Holds the plant's state, so one per worker.

    The noise of a plant with faults is drawn from the episode's seed and the `number` of the trial. Where none is given
    it is that of trial 0: candidates that are evaluated one by one all have the same noise.

    Args:
        plant: that candidates are tried on.
        nominal: the lumps that candidates are factors of.
        episode: what is done to the plant with each candidate.
        measure: a key of `MEASURES`.
        rule: the counting rule of the measure `count`; None for its usual one.

    Raises:
        EpisodeError: plant, nominal lumps and pushes differ in their number of joints, or no measure has that name
            and that rule.
    """

    def __init__(
        self,
        plant: Plant,
        nominal: Lumps,
        episode: Episode,
        measure: str,
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
        self._loop: Loop = _fastest_loop(plant, nominal, episode)
        self._ceiling = self.measure.ceiling(episode, self._loop.plant.timestep)

    def record(self, factors: Array, number: int = 0, goes_on: GoesOn | None = None) -> Record:
        """What the episode of a candidate with these `factors` (nlump) shows in the trial of that `number`, as long as
        it `goes_on`.  Raises EpisodeError where they are none, LostPlant and AbsentPlant.
        """
        return self._loop.run(self.nominal.scaled(_checked(factors, len(self.nominal.names))), number, goes_on)

    def watch(self, factors: Array, number: int = 0) -> tuple[Record, Trajectory]:
        """The same, and the motion after the last push, step by step in Python."""
        with quiet_mujoco():
            return run_stepwise(self._loop.plant, self.nominal.scaled(factors), self._loop.episode, number)

    def close(self) -> None:
        """Lets go of the plant."""
        self.plant.close()

    def evaluate(self, factors: Array, number: int = 0, goes_on: GoesOn | None = None) -> Outcome:
        """The outcome for `factors` (nlump) of the nominal lumps in the trial of that `number`. After each push but the
        last `goes_on` is asked; where it says no, the outcome is of the pushes so far.  Raises as `record` does.
        """
        return self._outcome(self.record(factors, number, goes_on))

    def value(self, record: Record) -> float:
        """The measure of what pushes that did not fall showed."""
        return self.measure.value(record)

    def share(self, factors: Array, trials: Sequence[int]) -> Any:
        """A batch of candidates with these `factors` (ncandidate x nlump), of the `trials` with these numbers
        (ncandidate), for this objective and its like, each on a thread of its own, to work on.
        """
        return self._loop.new_batch(self.nominal.scaled(factors), trials)

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
            return failure(self.measure, self.episode, self.plant.timestep, str(record))
        fell = record.fall_step is not None
        value = (
            fall_value(self._ceiling, record.steps, self.episode.total_steps) if fell else self.measure.value(record)
        )
        periods = tuple(self.measure.periods(record).tolist())
        return Outcome(value, fell, record.steps, periods, windows=record.windows, readings=record.readings)

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


def _checked(factors: Array, nlump: int) -> Array:
    try:
        given = np.asarray(factors)
        vector = given.astype(np.float64) if given.dtype.kind in "fiub" else None
    except (TypeError, ValueError):
        vector = None
    if vector is None or vector.shape != (nlump,):
        raise EpisodeError(f"these are no factors (allowed: {nlump} numbers, one for each lump)")
    for factor in vector[~(np.abs(vector) <= LARGEST_FACTOR)][:1]:
        raise EpisodeError(f"a factor is {factor:g} (allowed: {-LARGEST_FACTOR:g} to {LARGEST_FACTOR:g})")
    return vector


def _fastest_loop(plant: Plant, nominal: Lumps, episode: Episode) -> Loop:
    if not isinstance(plant, MujocoPlant):
        return StepwiseLoop(plant, episode)
    step = fastest_step(plant)
    compiled: CompiledLoop | FaultyLoop = CompiledLoop(plant, episode, step)
    slow: Loop = StepwiseLoop(plant, episode)
    if plant.settings.faults.named or episode.lead or episode.readings_steps:
        compiled = faulty = FaultyLoop(plant, episode, step)
        slow = StepwiseLoop(faulty.plant, faulty.episode)
    if compiled.agrees_with_stepwise(nominal):
        return compiled
    warnings.warn(
        f"the compiled loop disagrees with the stepwise one on plant {plant.name}; using that, which is slow",
        stacklevel=3,
    )
    return slow
