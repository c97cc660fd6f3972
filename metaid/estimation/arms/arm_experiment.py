"""The experiment of a study of an arm as the estimate needs it: what is done, what is unknown, what is compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from metaid.episode import Outcome
from metaid.episode.arms import ArmEpisode
from metaid.estimation.approximation import HeldOut
from metaid.estimation.arms.arm_estimate import ArmEstimate
from metaid.estimation.arms.motions import ArmMotions
from metaid.estimation.arms.readings import ArmReadings
from metaid.estimation.arms.trials import ArmReadTrial, WatchedArmTrial, read_arm_trial, watched_arm_trial
from metaid.estimation.arms.unknowns import ArmUnknowns
from metaid.estimation.fit import find, refine
from metaid.estimation.noisy import hold_out
from metaid.models import Array

PROBES = 1  # the nominal arm's law alone: it leaves much to see
AGREED = 1e-6  # of what an unknown may be beforehand: two estimates that are so near each other are the same
RESTARTS = 3  # of a fit that explains nothing, from elsewhere
STILL_SHRINKS = 0.95  # of the widest interval before: a trial that leaves more of it is worth no other

SeenArmTrial = WatchedArmTrial | ArmReadTrial


@dataclass(frozen=True, eq=False)
class ArmExperiment:
    """What is the same in all trials of a study of an arm.

    Attributes:
        episode: what is done to the arm.
        searched: what is unknown of it.
        timestep: between two torques, in s.
        resolution: of the measure, in Hz; a value below it passes for coasting.
        noise: standard deviation of a reading of each joint (njoint), in rad or m; None where sensors are exact.
    """

    episode: ArmEpisode
    searched: ArmUnknowns
    timestep: float
    resolution: float
    noise: Array | None = None

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
        more.
        """
        return is_settled

    def trial(self, values: Array, outcome: Outcome) -> SeenArmTrial | None:
        """A trial whose law had these base parameters (nbase), and what was seen of it; None where nothing was."""
        law, episode = self.searched.belief.parameters_at(values), self.episode
        shown, read = outcome.windows, outcome.readings
        if self.noise is None:
            return None if shown is None else watched_arm_trial(law, episode, self.timestep, shown)
        frames = self.searched.frames
        return None if read is None else read_arm_trial(frames, law, episode, self.timestep, read, self.noise)

    def estimate(
        self, trials: Sequence[SeenArmTrial], start: ArmEstimate | None = None, thorough: bool = True
    ) -> ArmEstimate | None:
        """What all `trials` say; None where they showed nothing, or no arm shows what they did.

        A `start` that explained the trials before is where the fit begins. Where that explains nothing, a `thorough`
        fit begins elsewhere.
        """
        return estimate_arm(list(trials), self.searched, start, thorough)

    def held_out(self, trials: Sequence[SeenArmTrial], estimate: ArmEstimate) -> HeldOut | None:
        """How well fits to some of the pushes of the `trials` predict the others, from an `estimate` on. None without
        noise, where a model that leaves more than rounding is wrong, and where there are too few pushes.
        """
        read = [trial for trial in trials if isinstance(trial, ArmReadTrial)]
        return hold_out(ArmReadings(read, self.searched), estimate.point) if read else None

    def factors(self, estimate: ArmEstimate) -> Array:
        """The base parameters (nbase) of the law that an `estimate` has."""
        return estimate.values

    def is_coasting(self, value: float) -> bool:
        """Whether a trial with this `value` of the measure coasts."""
        return self.noise is None and value <= self.resolution

    def is_settled(self, before: ArmEstimate, after: ArmEstimate) -> bool:
        """Whether one more trial tells no more, from the estimate `before` the last one to the one `after` it: without
        noise where they agree, else where intervals have stopped shrinking. An arm with dry friction never coasts as
        well as can be told: a law that takes it for smooth chatters.
        """
        if self.noise is None:
            moved = np.abs(after.unknowns - before.unknowns).max()
            return float(moved) <= AGREED * self.searched.spread
        return float(after.deviations.max()) > STILL_SHRINKS * float(before.deviations.max())


def estimate_arm(
    trials: Sequence[WatchedArmTrial | ArmReadTrial],
    searched: ArmUnknowns,
    start: ArmEstimate | None = None,
    thorough: bool = True,
) -> ArmEstimate | None:
    """What all `trials` say; None where they showed nothing, or no arm shows what they did.

    Args:
        trials: all of one kind.
        searched: what is unknown.
        start: where the fit begins, where it explained the trials before.
        thorough: whether a fit that explains nothing begins elsewhere.
    """
    begin = start.unknowns if start is not None and start.is_explained else None
    try:
        compared: ArmMotions | ArmReadings
        if isinstance(trials[0], WatchedArmTrial):
            compared = ArmMotions([trial for trial in trials if isinstance(trial, WatchedArmTrial)], searched)
        else:
            compared = ArmReadings([trial for trial in trials if isinstance(trial, ArmReadTrial)], searched)
    except ValueError:
        return None
    found = None if begin is None else refine(compared, begin)
    if found is None:
        found = find(compared, searched.geared if begin is None else begin, RESTARTS if thorough else 0)
    return None if found is None else ArmEstimate(**vars(found), searched=searched)
