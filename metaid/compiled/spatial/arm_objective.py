"""One candidate of an arm, one episode, one outcome. It knows neither samplers nor storage."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import count

import numpy as np

from metaid.compiled.spatial.arm_loop import ArmLoop
from metaid.episode import Outcome, fall_value
from metaid.episode.spatial import (
    ArmEpisode,
    ArmRecord,
    StepwiseArmLoop,
    ceiling_hz,
    failed_push,
    smoothed_arm_frequency,
)
from metaid.errors import AbsentPlant, EpisodeError, LostPlant
from metaid.models import Array
from metaid.models.tree import ArmPrior
from metaid.plant import ArmPlant, SocketPlant


@dataclass
class ArmBatch:
    """Candidates by their base parameters `values` (ncandidate x nbase), of the `trials` with these numbers, that
    several objectives work on. `next` says which comes next; `outcomes` are those that are done.
    """

    values: Array
    trials: Sequence[int]
    next: count[int] = field(default_factory=count)
    outcomes: dict[int, Outcome] = field(default_factory=dict)


class ArmObjective:
    """Evaluates base parameters on an arm, simulated or a rig. Holds the plant's state, so one per worker.

    Args:
        plant: that candidates are tried on.
        prior: of the arm; what base parameters leave open is most probable by it.
        episode: what is done to the plant with each candidate.
    """

    def __init__(self, plant: ArmPlant | SocketPlant, prior: ArmPrior, episode: ArmEpisode) -> None:
        self.plant, self.prior, self.episode = plant, prior, episode
        self._loop: ArmLoop | StepwiseArmLoop = (
            StepwiseArmLoop(plant, prior.nominal, episode)
            if isinstance(plant, SocketPlant)
            else ArmLoop(plant, prior.nominal, episode)
        )

    def record(self, values: Array, number: int = 0) -> ArmRecord:
        """What the episode of a candidate with these base parameters (nbase) shows in the trial of that `number`.

        Raises EpisodeError where they are none, LostPlant and AbsentPlant where a rig does not answer.
        """
        checked = np.asarray(values, dtype=np.float64)
        if checked.shape != self.prior.values.shape or not np.isfinite(checked).all():
            raise EpisodeError(
                f"these are no base parameters (allowed: {len(self.prior.values)} finite numbers, one for each)"
            )
        return self._loop.run(self.prior.parameters_at(checked), number)

    def value(self, record: ArmRecord) -> float:
        """The measure of what pushes that did not fall showed."""
        return min(self._frequency(record), ceiling_hz(record.timestep))

    def evaluate(self, values: Array, number: int = 0, goes_on: Callable[[ArmRecord], bool] | None = None) -> Outcome:
        """The outcome for base parameters (nbase) in the trial of that `number`. After each push but the last, unless
        one fell, `goes_on` is asked; where it says no, the outcome is of the pushes so far.  Raises as `record` does.

        A trial in which a push fell is a fall, though the others are none the worse for it.
        """
        record = self.record(values, number)
        for pushes in range(1, self.episode.npush):
            so_far = record.first(pushes)
            if goes_on is None or so_far.fell.any():
                break
            if not goes_on(so_far):
                record = so_far
                break
        steps, whole = int(record.steps.sum()), self.episode.total_steps
        fell = bool(record.fell.any())
        value = fall_value(ceiling_hz(record.timestep), steps, whole) if fell else self.value(record)
        uncounted = (0,) * self.plant.njoint
        return Outcome(value, fell, steps, uncounted, windows=record.windows, readings=record.readings)

    def _frequency(self, record: ArmRecord) -> float:
        if record.readings is None:
            return record.frequency
        return smoothed_arm_frequency(record, self.episode, self.prior.nominal)

    def share(self, values: Array, trials: Sequence[int]) -> ArmBatch:
        """A batch of candidates with these base parameters (ncandidate x nbase), of the `trials` with these numbers,
        for this objective and its like, each on a thread of its own, to work on.
        """
        return ArmBatch(values, trials)

    def work_on(self, batch: ArmBatch) -> None:
        """Runs episodes of the `batch` until there are none left; others may do so at the same time.  Raises
        AbsentPlant.
        """
        while (candidate := next(batch.next)) < len(batch.values):
            try:
                batch.outcomes[candidate] = self.evaluate(batch.values[candidate], batch.trials[candidate])
            except AbsentPlant:
                raise  # nor is it there for the next
            except LostPlant as problem:
                batch.outcomes[candidate] = failed_push(self.episode, self.plant.timestep, str(problem))

    def outcomes(self, batch: ArmBatch) -> list[Outcome]:
        """The outcomes of a `batch`'s candidates (ncandidate), once everyone is back from it."""
        return [batch.outcomes[candidate] for candidate in range(len(batch.values))]

    def close(self) -> None:
        """Lets go of the plant."""
        self.plant.close()
