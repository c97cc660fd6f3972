"""The experiment of a planar chain: what is pushed, what of it is unknown, and what its trials show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from metaid.episode import Outcome
from metaid.estimation.counting import Counts
from metaid.estimation.estimate import Estimate
from metaid.estimation.experiment import Experiment, OfReadings
from metaid.estimation.faults import NO_FAULTS, SearchedFaults, searched_faults
from metaid.estimation.motions import Motions, Quantity
from metaid.estimation.noisy import Innovations, Readings, ReadTrial, centred, commanded_torques, filtered_speeds
from metaid.estimation.trials import WatchedTrial
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array, Lumps

PROBES = {"speed": 1, "both": 1, "frequency": 2, "count": 10}  # trials that over-compensate, by what is compared
OVER_COMPENSATED = 1.5  # factor of the gravity lumps in the first law, of those that the search starts from
PROBED = 1.6, 2.6  # factors of the gravity lumps in a probe, drawn at random
# The same where torques are noisy: quick swings at large accelerations, beside which the noise is small.
PROBED_ROUGHLY = 5.0, 7.0
STILL_SHRINKS = 0.95  # of the widest interval before: a trial that leaves more of it is worth no other

SeenTrial = WatchedTrial | ReadTrial
Compared = Quantity | Literal["count"]


@dataclass(frozen=True)
class ChainExperiment(Experiment):
    """That of a planar chain.

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

    def factors(self, estimate: Estimate) -> Array:
        """The factors of the nominal lumps (nlump) that the law of an `estimate` has."""
        searched = self.nominal.searched
        factors: Array = estimate.lumps.vector_of(searched) / self.nominal.vector_of(searched)
        return factors


@dataclass(frozen=True)
class SilentExperiment(ChainExperiment):
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

    def is_settled(self, before: Any, after: Any) -> bool:
        return False  # such a plant coasts

    def _comparison(self, trials: Sequence[WatchedTrial]) -> Motions | Counts:
        seen = [trial for trial in trials if trial.windows.seen.any()]
        if self.compared == "count":
            return Counts(seen, self.unknowns, self.gravity)
        return Motions(seen, self.unknowns, self.gravity, self.compared)


@dataclass(frozen=True)
class NoisyExperiment(OfReadings, ChainExperiment):
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

    def is_settled(self, before: Any, after: Any) -> bool:
        if self.torque_noise is not None:  # a trial narrows the intervals of those lumps that it shows
            return bool((after.deviations > STILL_SHRINKS * before.deviations).all())
        return float(after.deviations.max()) > STILL_SHRINKS * float(before.deviations.max())

    @property
    def declared_delay(self) -> float:
        return self.delay * self.timestep * self.substeps

    def _search(self, kinds: tuple[str, ...]) -> SearchedFaults:
        return searched_faults(kinds, self.unknowns, self.gravity, self.start_speeds)

    def _comparison(self, trials: Sequence[ReadTrial]) -> Readings:
        kind = Readings if self.torque_noise is None else Innovations
        return kind(trials, self.unknowns, self.gravity, faults=self.faults)
