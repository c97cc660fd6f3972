"""The experiment of a study of an arm as the estimate needs it: what is done, what is unknown, what is compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from metaid.compiled.spatial import Frames, commanded_arm_torques
from metaid.episode import Outcome, SensorReadings, Windows
from metaid.episode.spatial import ArmEpisode
from metaid.estimation.estimate import Found, fit
from metaid.estimation.experiment import RESTARTS, SOME, OfReadings
from metaid.estimation.faults import NO_FAULTS, SearchedFaults, searched_faults
from metaid.estimation.noisy import Innovations, Loop, Readings, fit_with_torque_noise
from metaid.estimation.spatial.motions import ArmMotions
from metaid.estimation.spatial.unknowns import SPREAD, ArmEstimate, ArmUnknowns
from metaid.estimation.trials import ReadTrial, WatchedArmTrial
from metaid.models import Array

PROBES = 1  # the nominal arm's law alone: it leaves much to see
AGREED = 1e-6  # of what an unknown may be beforehand: two estimates that are so near each other are the same
STILL_SHRINKS = 0.95  # of the widest interval before: a trial that leaves more of it is worth no other

SeenArmTrial = WatchedArmTrial | ReadTrial


@dataclass(frozen=True, eq=False)
class ArmExperiment(OfReadings):
    """What is the same in all trials of a study of an arm.

    Attributes:
        episode: what is done to the arm.
        searched: what is unknown of it.
        timestep: between two torques, in s.
        resolution: of the measure, in Hz; a value below it passes for coasting.
        loop: how the arm is controlled and read; None where sensors are exact.
        faults: that are searched beside what is unknown of the arm.
        takes_up: whether faults are searched, too, once nothing explains the trials without them.
        torque_noise: what the noise of each joint's torque (njoint) is said to be, in N m; None where torques have
            none. How large it is, is found.
    """

    episode: ArmEpisode
    searched: ArmUnknowns
    timestep: float
    resolution: float
    loop: Loop | None = None
    faults: SearchedFaults = NO_FAULTS
    takes_up: bool = False
    torque_noise: Array | None = None

    leads_on: ClassVar[bool] = True
    scale: ClassVar[float] = SPREAD

    @property
    def probes(self) -> int:
        """How many trials an estimate needs."""
        return PROBES

    def probe(self, start: Array, random: np.random.Generator | None) -> Array:
        """Base parameters (nbase) whose law shows much: those of the `start`, or at `random` of an arm like it."""
        if random is None:
            return start
        return self.searched.values(self.searched.spread * random.standard_normal(len(start)))

    def is_to_probe(self, trials: int, is_settled: bool) -> bool:
        """Whether the law after so many `trials` is another than that of the estimate: where one more of it tells no
        more; with noisy torques every other one, for one that coasts shows little.
        """
        return is_settled if self.torque_noise is None else trials % 2 == 1

    def trial(self, values: Array, outcome: Outcome) -> SeenArmTrial | None:
        """A trial whose law had these base parameters (nbase), and what was seen of it; None where nothing was."""
        law, shown, read = self.searched.prior.parameters_at(values), outcome.windows, outcome.readings
        if self.loop is None:
            return None if shown is None else watched_arm_trial(law, self.episode, self.timestep, shown)
        return None if read is None else read_arm_trial(self.searched.frames, law, self.episode, self.loop, read)

    def _fit(self, compared: Any, begin: Array | None, restarts: int) -> Found:
        if self.torque_noise is not None and isinstance(compared, Innovations):
            return fit_with_torque_noise(compared, self._begin(begin), self.torque_noise)
        found: Found = fit(compared, self._begin(begin), restarts, refines=begin is not None)
        return found

    def _begin(self, begin: Array | None) -> Array:
        return np.append(self.searched.begin, np.zeros(len(self.faults.names))) if begin is None else begin

    @property
    def _some_torque(self) -> Array:
        return SOME * self.searched.torques(0.0, float(np.abs(self.episode.begins[:, 1]).max()))

    def _search(self, kinds: tuple[str, ...]) -> SearchedFaults:
        return searched_faults(kinds, self.searched, 0.0, self.episode.begins[:, 1], self.faults.teeth)

    def _comparison(self, trials: Sequence[Any]) -> Any:
        return compared_of_arm(trials, self.searched, self.faults, self.torque_noise is not None)

    def factors(self, estimate: ArmEstimate) -> Array:
        """The base parameters (nbase) of the law that an `estimate` has."""
        return estimate.values

    def is_coasting(self, value: float) -> bool:
        """Whether a trial with this `value` of the measure coasts."""
        return self.loop is None and value <= self.resolution

    def is_settled(self, before: Any, after: Any) -> bool:
        """Whether one more trial tells no more, from the estimate `before` the last one to the one `after` it: without
        noise where they agree, else where intervals have stopped shrinking. An arm with dry friction never coasts as
        well as can be told: a law that takes it for smooth chatters.
        """
        if self.loop is None:
            moved = np.abs(after.unknowns - before.unknowns).max()
            return float(moved) <= AGREED * self.searched.spread
        return float(after.deviations.max()) > STILL_SHRINKS * float(before.deviations.max())


def compared_of_arm(
    trials: Sequence[SeenArmTrial],
    searched: ArmUnknowns,
    faults: SearchedFaults = NO_FAULTS,
    has_torque_noise: bool = False,
) -> ArmMotions | Readings:
    """What is compared of `trials`, all of one kind.  Raises ValueError where they show nothing.

    Args:
        trials: of an arm.
        searched: what is unknown of it.
        faults: that are unknown beside that.
        has_torque_noise: whether torques are noisy.
    """
    read = [trial for trial in trials if isinstance(trial, ReadTrial)]
    if read:
        return (Innovations if has_torque_noise else Readings)(read, searched, faults=faults)
    return ArmMotions([trial for trial in trials if not isinstance(trial, ReadTrial)], searched)


def estimate_arm(
    trials: Sequence[SeenArmTrial], searched: ArmUnknowns, start: ArmEstimate | None = None, thorough: bool = True
) -> ArmEstimate | None:
    """What all `trials` say; None where they showed nothing, or no arm shows what they did.

    Args:
        trials: all of one kind.
        searched: what is unknown.
        start: where the fit begins, where it explained the trials before.
        thorough: whether a fit that explains nothing begins elsewhere.
    """
    begin = start.start if start is not None and start.is_explained else None
    try:
        compared = compared_of_arm(trials, searched)
        found: ArmEstimate = fit(
            compared, searched.begin if begin is None else begin, RESTARTS if thorough else 0, refines=begin is not None
        )
    except ValueError:
        return None
    return found


def watched_arm_trial(law: Array, episode: ArmEpisode, timestep: float, windows: Windows) -> WatchedArmTrial:
    """The trial on exact sensors in which a law led to these windows.

    Args:
        law: parameters of the candidate that was sent (njoint x 13).
        episode: what was done.
        timestep: between two torques, in s.
        windows: what was seen.
    """
    return WatchedArmTrial(law, timestep, episode.states, episode.stiffness, windows)


def read_arm_trial(frames: Frames, law: Array, episode: ArmEpisode, loop: Loop, read: SensorReadings) -> ReadTrial:
    """The trial on noisy sensors in which a law led to these readings.

    Args:
        frames: of the arm.
        law: parameters of the candidate that was sent (njoint x 13).
        episode: what was done.
        loop: how the arm is controlled and read.
        read: what the sensors read.
    """
    poses, speeds = np.ascontiguousarray(episode.begins.swapaxes(0, 1))
    return loop.trial(read, speeds, partial(commanded_arm_torques, frames, law, episode), poses)
