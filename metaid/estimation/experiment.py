"""A study's experiment as the estimate needs it: how the plant is pushed, what is unknown of it, what is compared."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from metaid.episode import Outcome
from metaid.estimation.approximation import HeldOut
from metaid.estimation.counting import Counts, match_counts
from metaid.estimation.estimate import Comparison, Estimate, fit
from metaid.estimation.faults import NO_FAULTS, Proposal, SearchedFaults, TakenUp, Unmodelled, searched_faults
from metaid.estimation.motions import Motions, Quantity
from metaid.estimation.noisy import (
    Innovations,
    Readings,
    ReadTrial,
    centred,
    commanded_torques,
    explanations,
    filtered_speeds,
    fit_with_torque_noise,
    hold_out,
    proposed_faults,
    take_up,
    unmodelled_forces,
)
from metaid.estimation.trials import Replay, WatchedTrial
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array, Lumps

PROBES = {"speed": 1, "both": 1, "frequency": 2, "count": 10}  # trials that over-compensate, by what is compared
OVER_COMPENSATED = 1.5  # factor of the gravity lumps in the first law, of those that the search starts from
PROBED = 1.6, 2.6  # factors of the gravity lumps in a probe, drawn at random
# The same where torques are noisy: quick swings at large accelerations, beside which the noise is small.
PROBED_ROUGHLY = 5.0, 7.0
RESTARTS = 3  # of a fit that explains nothing, from elsewhere
STILL_SHRINKS = 0.95  # of the widest interval before: a trial that leaves more of it is worth no other

SeenTrial = WatchedTrial | ReadTrial
Compared = Quantity | Literal["count"]


@dataclass(frozen=True)
class Experiment(ABC):
    """What is the same in all trials of a study.

    Attributes:
        nominal: the lumps that candidates are factors of.
        unknowns: what an estimate is of; it may have lumps that no law has, those of inertia.
        gravity: in m/s².
        timestep: in which the plant moves, in s.
        start_speeds: joint speeds (npush x njoint) right after each push, in rad/s.
    """

    nominal: Lumps
    unknowns: Unknowns
    gravity: float
    timestep: float
    start_speeds: Array

    @abstractmethod
    def trial(self, factors: Array, outcome: Outcome) -> SeenTrial | None:
        """A trial whose law had these `factors` (nlump) of the nominal lumps, and what was seen of it; None where
        nothing of it is known.
        """

    @property
    @abstractmethod
    def probes(self) -> int:
        """How many trials that over-compensate an estimate needs."""

    def probe(self, start: Array, random: np.random.Generator | None) -> Array:
        """Factors (nlump) of a law that over-compensates: those of the `start` with larger ones of gravity lumps, the
        first time the same of all, then at `random`.
        """
        factors = start.copy()
        factors[: self.nominal.nlink] *= (
            OVER_COMPENSATED if random is None else random.uniform(*self.probed, self.nominal.nlink)
        )
        return factors

    @property
    def probed(self) -> tuple[float, float]:
        """Between which a probe draws its factors of the gravity lumps."""
        return PROBED

    def is_to_probe(self, trials: int, is_settled: bool) -> bool:
        """Whether the law after so many `trials` over-compensates what the estimate has: where intervals have
        stopped shrinking, for one that coasts shows no more.
        """
        return is_settled

    @abstractmethod
    def is_coasting(self, value: float) -> bool:
        """Whether a trial with this `value` of the measure coasts."""

    @abstractmethod
    def is_settled(self, before: Estimate, after: Estimate) -> bool:
        """Whether intervals have stopped shrinking from the estimate `before` the last trial to the one `after` it."""

    @abstractmethod
    def _comparison(self, trials: Sequence[Any]) -> Comparison | Counts:
        """What is compared with the twin.  Raises ValueError where `trials` show nothing."""

    def estimate(
        self, trials: Sequence[SeenTrial], start: Estimate | None = None, thorough: bool = True
    ) -> Estimate | None:
        """What all `trials` say; None where they showed nothing, or no chain shows what they did.

        A `start` that explained the trials before is where the fit begins. Where that explains nothing, a
        `thorough` fit begins elsewhere RESTARTS times.
        """
        begin = start.start if start is not None and start.is_explained else None
        try:
            compared = self._comparison(trials)
            return self._fit(compared, begin, RESTARTS if thorough else 0)
        except ValueError:
            return None

    def _fit(self, compared: Comparison | Counts, begin: Array | None, restarts: int) -> Estimate:
        """What is compared says of the chain.  Raises ValueError where no chain shows what was seen."""
        if isinstance(compared, Counts):
            return match_counts(compared, begin, restarts)
        return fit(compared, begin, restarts)

    def unmodelled(self, trials: Sequence[Any], estimate: Estimate) -> list[Unmodelled]:
        """Forces that the model has not, as far as the `trials` show them beside an `estimate` of them. Without noise
        there are none: the misfit says all.
        """
        return []

    def taken_up(self, trials: Sequence[Any], estimate: Estimate) -> tuple[Experiment, Estimate, TakenUp | None]:
        """What the `trials` say with the faults that explain them, where an experiment takes up faults by itself: the
        experiment that searches these, its estimate, and what speaks for them; else this experiment and the `estimate`.
        """
        return self, estimate, None

    def proposed(self, trials: Sequence[Any], estimate: Estimate) -> Proposal | None:
        """Faults that would explain what an `estimate` of the `trials` does not, if they were searched, too. None where
        none does, or no readings were kept to try it.
        """
        return None

    def held_out(self, trials: Sequence[Any], estimate: Estimate) -> HeldOut | None:
        """How well fits to some of the pushes of the `trials` predict the others, from an `estimate` on. None without
        noise, where a model that leaves more than rounding is wrong, and where there are too few pushes.
        """
        return None

    def replay(self, trials: Sequence[SeenTrial], estimate: Estimate, number: int) -> Replay:
        """What was seen of one of the `trials` that an `estimate` is made of, and what the twin at the estimate shows
        in its place; `number` is that of its table in `estimate.residuals`.
        """
        return self._comparison(trials).replay(number, estimate.point)

    def factors(self, estimate: Estimate) -> Array:
        """The factors of the nominal lumps (nlump) that the law of an `estimate` has."""
        searched = self.nominal.searched
        factors: Array = estimate.lumps.vector_of(searched) / self.nominal.vector_of(searched)
        return factors


@dataclass(frozen=True)
class SilentExperiment(Experiment):
    """One without noise: the windows of each push are compared, with a twin under the same law.

    `compared`: what of the motion. `resolution`: of the measure, in its unit; a value below it passes for coasting.
    `stiffness`: k of the law, in 1/s².
    """

    compared: Compared
    resolution: float
    stiffness: float = 0.0

    def trial(self, factors: Array, outcome: Outcome) -> WatchedTrial | None:
        if outcome.windows is None:
            return None
        law = self.nominal.scaled(factors)
        return WatchedTrial(law, self.timestep, self.start_speeds, outcome.windows, self.stiffness)

    @property
    def probes(self) -> int:
        return PROBES[self.compared]

    def is_coasting(self, value: float) -> bool:
        return value <= self.resolution

    def is_settled(self, before: Estimate, after: Estimate) -> bool:
        return False  # such a plant coasts

    def _comparison(self, trials: Sequence[WatchedTrial]) -> Motions | Counts:
        seen = [trial for trial in trials if trial.windows.seen.any()]
        if self.compared == "count":
            return Counts(seen, self.unknowns, self.gravity)
        return Motions(seen, self.unknowns, self.gravity, self.compared)


@dataclass(frozen=True)
class NoisyExperiment(Experiment):
    """One with noise: the sensors' readings are compared, with a twin that is driven by what was commanded.

    Attributes:
        start_spread: what pushes differ by, as `ReadTrial` has it (npush x njoint x njoint), in rad/s, or None.
        noise: standard deviation of a reading of each joint (njoint), in rad, from the plant at rest.
        speed_weights: of the last angle readings (nreading), in 1/s, for the speed where there is no sensor of it.
        substeps: how many timesteps a torque holds.
        delay: how many torques late it is.
        lead: seconds by which the law looks ahead.
        has_unknown_encoders: whether the resolution of the encoders is to be seen in the readings; else it is in the
            `noise`.
        is_continuous: whether the plant moves continuously, as a real one does, and not in steps, as a simulated one.
        faults: that are searched beside the lumps.
        takes_up: whether faults are searched, too, once nothing explains the trials without them.
        torque_limits: what the motors are said to give at most (njoint), in N m.
        torque_noise: what the noise of each joint's torque (njoint) is said to be, in N m; None where torques have
            none. How large it is, is found.
    """

    start_spread: Array | None
    noise: Array
    speed_weights: Array
    substeps: int = 1
    delay: int = 0
    lead: float = 0.0
    has_unknown_encoders: bool = False
    is_continuous: bool = False
    faults: SearchedFaults = NO_FAULTS
    takes_up: bool = False
    torque_limits: Array | float = np.inf
    torque_noise: Array | None = None

    def trial(self, factors: Array, outcome: Outcome) -> ReadTrial | None:
        read = outcome.readings
        if read is None:
            return None
        speeds = read.speeds
        if speeds is None:
            speeds = filtered_speeds(read.angles, self.start_speeds, self.speed_weights)
        law = self.nominal.scaled(factors)
        loop = self.lead, self.delay, self.torque_limits
        torques = commanded_torques(law, read.angles, speeds, self.gravity, *loop)
        if self.is_continuous:
            torques = centred(torques, self.substeps)
        pushes = self.start_speeds, self.start_spread
        noise = np.hypot(self.noise, read.encoder_steps / np.sqrt(12.0)) if self.has_unknown_encoders else self.noise
        return ReadTrial(self.timestep, read.angles, torques, read.steps, *pushes, noise, self.substeps)

    @property
    def probes(self) -> int:
        return 1

    @property
    def probed(self) -> tuple[float, float]:
        return PROBED if self.torque_noise is None else PROBED_ROUGHLY

    def is_to_probe(self, trials: int, is_settled: bool) -> bool:
        """Where torques are noisy, every other law does: one that coasts shows gravity lumps alone, and one that swings
        the others.
        """
        return is_settled if self.torque_noise is None else trials % 2 == 1

    def is_coasting(self, value: float) -> bool:
        return False  # noise hides how well it coasts: its intervals say how well the plant is known

    def is_settled(self, before: Estimate, after: Estimate) -> bool:
        if self.torque_noise is not None:  # a trial narrows the intervals of those lumps that it shows
            return bool((after.deviations > STILL_SHRINKS * before.deviations).all())
        return float(after.deviations.max()) > STILL_SHRINKS * float(before.deviations.max())

    def _fit(self, compared: Comparison | Counts, begin: Array | None, restarts: int) -> Estimate:
        if self.torque_noise is None or not isinstance(compared, Innovations):
            return super()._fit(compared, begin, restarts)
        return fit_with_torque_noise(compared, begin, self.torque_noise)

    def unmodelled(self, trials: Sequence[ReadTrial], estimate: Estimate) -> list[Unmodelled]:
        led = self._led(trials, estimate)
        return [] if led is None else list(unmodelled_forces(led, estimate))

    def estimate(self, trials: Sequence[Any], start: Estimate | None = None, thorough: bool = True) -> Estimate | None:
        if not self.takes_up:
            return super().estimate(trials, start, thorough)
        if start is not None and start.faults is not None:
            found = self._searching(start.faults.searched).estimate(trials, start, thorough=False)
            if found is not None and found.is_explained:
                return found
            start = None
        found = super().estimate(trials, start, thorough=False)
        if found is None or found.is_explained:
            return found
        explained = next(explanations(self._comparison(trials), found, self._search), None)
        if explained is None and thorough:
            return super().estimate(trials, start)
        return explained or found

    def taken_up(
        self, trials: Sequence[ReadTrial], estimate: Estimate
    ) -> tuple[NoisyExperiment, Estimate, TakenUp | None]:
        if not self.takes_up:
            return self, estimate, None
        found, taken = take_up(self._comparison(trials), estimate, self._search)
        return (self if found.faults is None else self._searching(found.faults.searched)), found, taken

    def proposed(self, trials: Sequence[ReadTrial], estimate: Estimate) -> Proposal | None:
        if self.takes_up or self.torque_noise is not None:
            return None  # none of them explains the trials; or gains of a filter that are those without it
        declared = self.delay * self.timestep * self.substeps
        return proposed_faults(self._comparison(trials), estimate, self._search, declared)

    def held_out(self, trials: Sequence[ReadTrial], estimate: Estimate) -> HeldOut | None:
        led = self._led(trials, estimate)
        return None if led is None else hold_out(led, estimate.point)

    def _search(self, kinds: tuple[str, ...]) -> SearchedFaults:
        """Faults of these `kinds` as unknowns."""
        return searched_faults(kinds, self.unknowns.nominal, self.gravity, self.start_speeds)

    def _searching(self, faults: SearchedFaults) -> NoisyExperiment:
        """The same where these `faults` are searched from the first trial on."""
        return replace(self, faults=faults, takes_up=False)

    def _comparison(self, trials: Sequence[ReadTrial]) -> Readings:
        kind = Readings if self.torque_noise is None else Innovations
        return kind(trials, self.unknowns, self.gravity, faults=self.faults)

    def _led(self, trials: Sequence[ReadTrial], estimate: Estimate) -> Readings | None:
        """What is compared at an `estimate`; None where the twin cannot follow."""
        compared = self._comparison(trials)
        if estimate.torque_noise is None or not isinstance(compared, Innovations):
            return compared
        return compared.led(estimate.point, estimate.torque_noise)
