"""The laws that the trials of a study are sent, of a chain and of an arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.episode import Episode
from metaid.estimation.base_unknowns import ArmEstimate, BaseUnknowns
from metaid.estimation.log_unknowns import Estimate
from metaid.models import Array, ChainModel, Lumps

OVER_COMPENSATED = 1.5  # factor of the gravity lumps in the first law, of those that the search starts from
PROBED = 1.6, 2.6  # factors of the gravity lumps in a probe, drawn at random
# The same where torques are noisy: quick swings at large accelerations, beside which the noise is small.
PROBED_ROUGHLY = 5.0, 7.0


@dataclass(frozen=True, eq=False)
class ChainLaws:
    """Lumps: a candidate is factors (nlump) of those of the `nominal` chain. `gravity` in m/s²."""

    nominal: Lumps
    gravity: float

    def law(self, candidate: Array) -> Lumps:
        """That of a `candidate` (n)."""
        return self.nominal.scaled(candidate)

    def candidate(self, estimate: Estimate) -> Array:
        """The candidate (n) whose law an `estimate` has."""
        searched = self.nominal.searched
        factors: Array = estimate.lumps.vector_of(searched) / self.nominal.vector_of(searched)
        return factors

    def probe(self, start: Array, random: np.random.Generator | None, is_rough: bool) -> Array:
        """A candidate (n) whose law shows much, from that of the `start`; where the noise of torques `is_rough`, beside
        that. It over-compensates, with larger gravity lumps, the first time by the same factor, then at `random`.
        """
        probed, nlink = PROBED_ROUGHLY if is_rough else PROBED, self.nominal.nlink
        factors = start.copy()
        factors[:nlink] *= OVER_COMPENSATED if random is None else random.uniform(*probed, nlink)
        return factors

    def commanded(self, law: Lumps, angles: Array, speeds: Array) -> Array:
        """The joint torques (npush x nstep x njoint), in N m, that a `law` makes of what it acted on: joint coordinates
        and speeds (npush x nstep + 1 x njoint each). None follows from the last.
        """
        return ChainModel(law, self.gravity).torque(angles[:, :-1], speeds[:, :-1])


@dataclass(frozen=True, eq=False)
class ArmLaws:
    """Parameters (njoint x 13): a candidate is base parameters (nbase) of the arm that is `searched`, in an `episode`
    that says about which poses springs hold it.
    """

    searched: BaseUnknowns
    episode: Episode

    def law(self, candidate: Array) -> Array:
        return self.searched.prior.parameters_at(candidate)

    def candidate(self, estimate: ArmEstimate) -> Array:
        return estimate.values

    def probe(self, start: Array, random: np.random.Generator | None, is_rough: bool) -> Array:
        """One like the arm beforehand."""
        if random is None:
            return start
        return self.searched.values(self.searched.spread * random.standard_normal(len(start)))

    def commanded(self, law: Array, angles: Array, speeds: Array) -> Array:
        from metaid.compiled.spatial import commanded_arm_torques  # loads numba

        return commanded_arm_torques(self.searched.frames, law, self.episode, angles, speeds)


Laws = ChainLaws | ArmLaws  # by the numbers of a candidate
