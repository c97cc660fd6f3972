"""What all trials of a study of a chain say together: the estimate of its lumps, with intervals, by whichever sampler.

It is kept with the study, so it is values alone. What is drawn of it besides, a replay or the estimates from the first
trials, is made of the trials when it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from metaid.estimation import Approximation, Estimate, HeldOut, Proposal, TakenUp, Unmodelled, has_mass
from metaid.models import Array, half_width
from metaid.study.identifiability import COARSEST

if TYPE_CHECKING:
    from metaid.estimation import ChainExperiment, Replay, SeenTrial

FEW_TRIALS = 3
MOST_SHOWN = 7  # numbers of trials, from each of which an estimate is shown
MOST_LEFT = 0.3  # of the squares of a misfit: a force that leaves more of it is not what is missing


@dataclass(frozen=True)
class StudyEstimate:
    """An estimate, and all that is said of it.

    Attributes:
        estimate: what the trials say.
        kinds: of its lumps.
        trials: how many it is made of.
        seen: makes the experiment and these trials, as that has them.
        by_others: how many of the last of them are not metaid's own.
        taken_up: what speaks for faults that were taken up; None where none were.
        forces: that the model has not, as far as the trials show them.
        held_out: how well fits to some pushes predict the others; None where the estimate explains what was seen to
            the noise, and where no push can be left out.
        proposal: faults that would explain what the estimate does not, were they searched; None where none does.
        known_from: how many of the first trials were enough to know every lump; None where it took too many, and
            where counts are compared, which every trial adds to.
    """

    estimate: Estimate
    kinds: tuple[str, ...]
    trials: int
    seen: Callable[[], tuple[ChainExperiment, tuple[SeenTrial, ...]]] = field(compare=False, repr=False)
    by_others: int = 0
    taken_up: TakenUp | None = None
    forces: tuple[Unmodelled, ...] = ()
    held_out: HeldOut | None = None
    proposal: Proposal | None = None
    known_from: int | None = None

    @cached_property
    def _behind(self) -> tuple[ChainExperiment, tuple[SeenTrial, ...]]:
        """The experiment that searches all that was found, and the trials."""
        experiment, trials = self.seen()
        return experiment.searching(self.estimate), trials

    @cached_property
    def growth(self) -> tuple[list[int], list[Estimate]]:
        """How many of the first trials there are, at most MOST_SHOWN different numbers of them, and the estimate from
        these; those that no estimate explains are left out. Each begins where the one before ended.
        """
        experiment, trials = self._behind
        numbers = np.unique(np.geomspace(1.0, self.trials, min(self.trials, MOST_SHOWN)).round().astype(int))
        counts, estimates, early = [], [], None
        with threadpool_limits(1):
            for count in numbers[numbers >= experiment.probes].tolist():
                whole, thorough = count == self.trials, count <= FEW_TRIALS
                early = self.estimate if whole else experiment.estimate(trials[:count], early, thorough)
                if early is not None and early.is_explained:
                    counts.append(count)
                    estimates.append(early)
        return counts, estimates

    @property
    def unmodelled(self) -> Unmodelled | None:
        """The force that the model has not and that the trials show best; None where they show none."""
        return min((each for each in self.forces if each.is_seen), key=lambda each: each.left, default=None)

    @cached_property
    def hinted(self) -> Unmodelled | None:
        """The force that the model has not and that the trials hint at best, though noise may look like it."""
        return min((each for each in self.forces if each.is_hinted), key=lambda each: each.left, default=None)

    @cached_property
    def lump_deviations(self) -> Array:
        """The standard deviation of each lump (nlump), as a share of it. It holds what a force would change that the
        trials hint at, and where the estimate does not explain them what the misfit and repetition say.
        """
        own = np.sqrt(np.diag(self.lump_covariance))
        if self.approximation is not None or self.hinted is None:
            return own
        return np.hypot(own, self.estimate.design @ self.hinted.shift)

    @cached_property
    def approximation(self) -> Approximation | None:
        """What the estimate is worth where it does not explain what was seen to the noise; None where it does, where
        something else speaks against it, and where no push can be left out.
        """
        if self.held_out is None:
            return None
        estimate, force = self.estimate, self.hinted
        count = len(estimate.names)
        return Approximation(
            self.held_out,
            estimate.misfit,
            estimate.residuals,
            tuple(f"joint {i + 1}" for i in range(estimate.lumps.nlink)),
            estimate.deviations,
            np.zeros(count) if force is None else force.shift,
            np.full(count, COARSEST),
            not self._impossible and has_mass(estimate.lumps),
        )

    @property
    def widening(self) -> float:
        """By how much the misfit makes standard deviations larger than if the model explained all."""
        return 1.0 if self.estimate.is_explained else self.estimate.misfit

    @property
    def covariance(self) -> Array:
        """Of the unknowns (nunknown x nunknown): where the estimate is approximate, as wide as its intervals are."""
        estimate = self.estimate
        if self.approximation is None:
            return estimate.covariance
        wider = self.approximation.deviations / estimate.deviations
        return np.asarray(estimate.covariance * np.outer(wider, wider), dtype=np.float64)

    @property
    def lump_covariance(self) -> Array:
        """The same of the log factors of the lumps (nlump x nlump)."""
        design = self.estimate.design
        return np.asarray(design @ self.covariance @ design.T, dtype=np.float64)

    @property
    def half_width(self) -> float:
        """Half the widest of intervals that hold all unknown lumps at once, as a share of its lump.  Eq. 64."""
        return self.estimate.half_width if self.hinted is None else half_width(self.lump_deviations)

    @property
    def reasons(self) -> list[str]:
        """What the study itself did to explain what was seen: a sentence, where it took up faults."""
        return [] if self.taken_up is None else [self.taken_up.description]

    @property
    def provisos(self) -> list[str]:
        """What must not be there for the lumps to be right, for the trials could not tell: sentences that name it."""
        said = []
        for force in self.forces:
            names = [name for name, reach in zip(self.estimate.names, force.reach, strict=True) if reach > COARSEST]
            if names:
                said.append(
                    f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} right only without {force.name}: "
                    f"these trials do not show {force.unseen}; push harder, or longer"
                )
        if self.hinted is not None:
            moved, change = _most_moved(self.estimate, self.hinted)
            said.append(
                f"the trials hint at {self.hinted.description}, with which {moved} would be {change}, so intervals "
                f"hold that, too ({self.hinted.advice})"
            )
        return said

    @property
    def explains(self) -> bool:
        """Whether the model explains what was seen, no force that it has not is seen, nothing speaks against faults
        that were taken up, and none that was found is one that no plant has.
        """
        holds = self.taken_up is None or self.taken_up.holds
        return holds and self.estimate.is_explained and not self._impossible and self.unmodelled is None

    @property
    def _impossible(self) -> list[str]:
        """The names of the faults that were found and that no plant has."""
        return [] if self.estimate.faults is None else self.estimate.faults.impossible

    @property
    def description(self) -> str:
        """How well the model explains what was seen, in a sentence."""
        estimate = self.estimate
        if estimate.counts is not None:
            return _describe_counts(estimate.misfit, estimate.explained_below, estimate.counts)
        found = f"misfit {estimate.misfit:.3g} (explained: below {estimate.explained_below:.3g})"
        if self.explains:
            return f"the model explains what was seen: {found}"
        if self.taken_up is not None and not self.taken_up.holds:
            return f"{self.taken_up.description}; {found}"
        if estimate.is_explained and self._impossible:
            return (
                f"what was seen is explained only with {', '.join(self._impossible)} below 0, which no plant has: "
                f"something else is there, or a torque has the wrong sign; {found}"
            )
        if self.proposal is not None:
            return f"the model does not explain what was seen, but {self.proposal.description}; {found}"
        force = self.unmodelled
        if force is None or (force.left > MOST_LEFT and not estimate.is_explained):
            return (
                "the model does not explain what was seen, be it for friction, play, torques that come late or are cut "
                f"off, or wrong lengths: {found}"
            )
        moved, change = _most_moved(estimate, force)
        return (
            f"the motion shows a force that the model has not, {force.description} or one like it: with it "
            f"{moved} would be {change} ({force.advice}); {found}"
        )

    @property
    def interval_name(self) -> str:
        """What `low` to `high` is."""
        return interval_name(self.estimate.counts)

    def lumps_of(self, estimate: Estimate) -> Array:
        """The lumps (nlump) of an `estimate`."""
        return estimate.lumps.vector_of(self.kinds)

    def replay(self, number: int | None = None) -> Replay:
        """One of the trials as the plant showed it and as the twin at the estimate moves. `number` is that of its table
        in `estimate.residuals`; by default see `worst_shown`.
        """
        experiment, trials = self._behind
        if number is None:
            number = worst_shown(self.estimate.residuals, self.explains)
        return experiment.replay(trials, self.estimate, number)


def _most_moved(estimate: Estimate, force: Unmodelled) -> tuple[str, str]:
    """The unknown of an `estimate` that a `force` would change most, and by how much, in words."""
    moved = int(np.argmax(np.abs(force.shift)))
    by = 100.0 * float(np.expm1(force.shift[moved]))
    return estimate.names[moved], f"{abs(by):.2g} % {'larger' if by > 0.0 else 'smaller'}"


def worst_shown(residuals: Sequence[Array], explains: bool) -> int:
    """The number of the trial that is worth a look, by the `residuals` of each (npush x njoint): the first, or, where
    the model explains nothing, the one that its twin shows worst.
    """
    return 0 if explains else int(np.argmax([np.nanmean(table**2) for table in residuals]))


def interval_name(counts: int | None) -> str:
    """What `low` to `high` is of an estimate for which so many `counts` were compared, or none."""
    return "95 % interval" if counts is None else "extent of the models that count the same"


def _describe_counts(misfit: float, explained_below: float, counts: int) -> str:
    """What it means that so many of all `counts` differ, in a sentence."""
    if misfit < explained_below:
        return f"the model counts what was counted: all {counts:,} counts of half periods are the same"
    return f"no model was found that counts what was counted: in the best, {misfit:,.0f} of {counts:,} counts differ"
