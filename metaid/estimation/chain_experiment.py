"""The experiment of a planar chain: what is pushed, what of it is unknown, and what its trials show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from metaid.episode import Outcome
from metaid.estimation.counting import Counts
from metaid.estimation.estimate import Estimate
from metaid.estimation.experiment import SOME, Experiment, OfReadings
from metaid.estimation.faults import NO_FAULTS, SearchedFaults, searched_faults
from metaid.estimation.motions import Motions, Quantity
from metaid.estimation.noisy import Innovations, Loop, Readings, ReadTrial, commanded_torques
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

    @property
    def counts(self) -> bool:
        return self.compared == "count"

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
        loop: how the plant is controlled and read.
        faults: that are searched beside the lumps.
        takes_up: whether faults are searched, too, once nothing explains the trials without them.
        torque_noise: what the noise of each joint's torque (njoint) is said to be, in N m; None where torques have
            none. How large it is, is found.
    """

    loop: Loop
    faults: SearchedFaults = NO_FAULTS
    takes_up: bool = False
    torque_noise: Array | None = None

    def trial(self, factors: Array, outcome: Outcome) -> ReadTrial | None:
        if outcome.readings is None:
            return None
        law = self.nominal.scaled(factors)
        commanded = partial(commanded_torques, law, gravity=self.gravity)
        return self.loop.trial(outcome.readings, self.start_speeds, commanded)

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
    def _some_torque(self) -> Array:
        speed = float(np.abs(self.start_speeds).max())
        return SOME * self.unknowns.torques(self.gravity, speed)

    def _search(self, kinds: tuple[str, ...]) -> SearchedFaults:
        return searched_faults(kinds, self.unknowns, self.gravity, self.start_speeds, self.faults.teeth)

    def _comparison(self, trials: Sequence[ReadTrial]) -> Readings:
        kind = Readings if self.torque_noise is None else Innovations
        return kind(trials, self.unknowns, self.gravity, faults=self.faults)
