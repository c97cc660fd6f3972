"""What all trials of a study say together: the estimate of its robot, with intervals, by whichever sampler.

It is kept with the study, so it is values alone. What is drawn of it besides, a replay or the estimates from the first
trials, is made of the trials when it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from metaid.estimation import Approximation, Found, HeldOutPushes, Prediction, Proposal, Replay, TakenUp, Unmodelled
from metaid.models import COARSEST, Array
from metaid.study.parameters import Known, Parameters

FEW_TRIALS = 3
MOST_SHOWN = 7  # numbers of trials, from each of which an estimate is shown
ROUNDING = 0.01  # of what noise would leave: a misfit below this is no noise
MOST_LEFT = 0.3  # of the squares of a misfit: a force that leaves more of it is not what is missing


@dataclass(frozen=True)
class StudyEstimate:
    """An estimate, and all that is said of it.

    Attributes:
        estimate: what the trials say.
        trials: how many it is made of.
        seen: makes the experiment and these trials, as that has them.
        by_others: how many of the last of them are not metaid's own.
        taken_up: what speaks for faults that were taken up; None where none were.
        forces: that the model has not, as far as the trials show them.
        prediction: how well pushes that were held out are predicted where the estimate explains what was seen; None
            where no push can be left out.
        held_out: how well fits to some pushes predict the others; None where the estimate explains and predicts what
            was seen to the noise, and where no push can be left out.
        proposal: faults that would explain what the estimate does not, were they searched; None where none does.
        known_from: how many of the first trials were enough to know every lump; None where it took too many, and
            where counts are compared, which every trial adds to.
    """

    estimate: Found
    trials: int
    seen: Callable[[], tuple[Any, tuple[Any, ...]]] = field(compare=False, repr=False)
    by_others: int = 0
    taken_up: TakenUp | None = None
    forces: tuple[Unmodelled, ...] = ()
    prediction: Prediction | None = None
    held_out: HeldOutPushes | None = None
    proposal: Proposal | None = None
    known_from: int | None = None

    @cached_property
    def _behind(self) -> tuple[Any, tuple[Any, ...]]:
        """The experiment that searches all that was found, and the trials."""
        experiment, trials = self.seen()
        return experiment.searching(self.estimate), trials

    @cached_property
    def growth(self) -> tuple[list[int], list[Any]]:
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
        """What the model has not and the trials show best; None where they show nothing."""
        return _clearest(each for each in self.forces if each.is_seen)

    @cached_property
    def hinted(self) -> Unmodelled | None:
        """What the model has not and the trials hint at best, though noise may look like it."""
        return _clearest(each for each in self.forces if each.is_hinted)

    @property
    def shifts(self) -> Array:
        """By how much unknowns would change (n x nunknown) with what the trials hint at, and with other faults that
        explain as much as those that were taken up: intervals hold each.
        """
        found = [] if self.hinted is None else [self.hinted.shift[None]]
        found += [] if self.taken_up is None else [self.taken_up.shifts]
        return np.concatenate([np.zeros((0, len(self.estimate.unknowns))), *found])

    @cached_property
    def approximation(self) -> Approximation | None:
        """What the estimate is worth where it does not explain what was seen to the noise, number by number; None where
        it does, where something else speaks against it, and where no push can be left out.
        """
        if self.held_out is None:
            return None
        estimate = self.estimate
        numbers = self.held_out.unknowns[:, : len(estimate.unknowns)] @ estimate.to_numbers.T
        return Approximation(
            replace(self.held_out, unknowns=numbers),
            estimate.widening,
            estimate.residuals,
            estimate.searched.joints,
            np.sqrt(np.diag(estimate.number_covariance)),
            np.linalg.norm(self._changes, axis=0),
            estimate.coarsest,
            estimate.torques(numbers),
            not self.impossible and estimate.is_possible,
        )

    @property
    def _changes(self) -> Array:
        """By how much what the estimate's `names` name (n x nname) would change with the `shifts`."""
        return np.asarray(self.shifts @ self.estimate.to_numbers.T, dtype=np.float64)

    @cached_property
    def covariance(self) -> Array:
        """Of what the estimate's `names` name (nname x nname). It holds what a force would change that the trials hint
        at; where the estimate is approximate it is as wide as its intervals are.
        """
        own = self.estimate.number_covariance
        if self.approximation is None:
            return np.asarray(own + self._changes.T @ self._changes, dtype=np.float64)
        wider = self.approximation.deviations / self.approximation.own
        return np.asarray(own * np.outer(wider, wider), dtype=np.float64)

    @cached_property
    def value_covariance(self) -> Array:
        """Of the values (nvalue x nvalue), in SI units."""
        return self.estimate.of_values(self.covariance)

    @property
    def deviations(self) -> Array:
        """Standard deviation of each value (nvalue), in its unit."""
        return np.sqrt(np.diag(self.value_covariance))

    def _shift_in_words(self, shift: Array) -> str:
        """What a `shift` of the unknowns (nunknown) would change most, and by how much."""
        return self.estimate.in_words(self.estimate.to_numbers @ shift)

    def _beyond(self, reach: Array) -> list[str]:
        """The names of what is not determined where the unknowns may be off by each of several independent changes,
        which are the columns of `reach` (nunknown x n).
        """
        far = np.linalg.norm(self.estimate.to_numbers @ reach, axis=1) > self.estimate.coarsest
        return [name for name, is_far in zip(self.estimate.names, far, strict=True) if is_far]

    @property
    def reasons(self) -> list[str]:
        """What the study itself did to explain what was seen: a sentence, where it took up faults."""
        return [] if self.taken_up is None else [self.taken_up.description]

    @property
    def provisos(self) -> list[str]:
        """What must not be there for the numbers to be right, for the trials could not tell: sentences that name it."""
        hidden = ((force, self._beyond(force.reach)) for force in self.forces if force.is_force)
        said = [
            f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} right only without {force.name}: "
            f"these trials do not show {force.unseen}; push harder, or longer"
            for force, names in hidden
            if names
        ]
        if self.hinted is not None:
            moved = self._shift_in_words(self.hinted.shift)
            said.append(
                f"the trials hint at {self.hinted.description}, with which {moved}, so intervals hold that, too "
                f"({self.hinted.advice})"
            )
        return said

    @property
    def explains(self) -> bool:
        """Whether the model explains what was seen, predicts what was held out and shows nothing that it has not, and
        no fault that was found is one that no plant has.
        """
        holds = self.prediction is None or self.prediction.holds
        return holds and self.estimate.is_explained and not self.impossible and self.unmodelled is None

    @property
    def impossible(self) -> list[str]:
        """The names of the faults that were found and that no plant has."""
        return [] if self.estimate.faults is None else self.estimate.faults.impossible

    @property
    def description(self) -> str:
        """How well the model explains what was seen, in a sentence."""
        estimate = self.estimate
        if estimate.counts is not None:
            return _describe_counts(estimate.misfit, estimate.explained_below, estimate.counts)
        left = f"{estimate.misfit:.3g}" if estimate.misfit >= ROUNDING else f"below {ROUNDING}"
        found = f"misfit {left} (explained: below {estimate.explained_below:.3g})"
        if self.explains:
            return f"the model explains what was seen: {found}"
        force = self.unmodelled
        if force is not None and not force.is_force and force.left <= MOST_LEFT:
            return self._lacking(force, found)
        if self.taken_up is not None and estimate.torque_noise is not None:
            rest = f"what is left is taken for noise of the torques of up to {estimate.torque_noise.max():.2g} N m"
            return f"{self.taken_up.description}; {rest}; {found}"
        if estimate.is_explained and self.impossible:
            return (
                f"what was seen is explained only with {', '.join(self.impossible)} below 0, which no plant has: "
                f"something else is there, or a torque has the wrong sign; {found}"
            )
        if self.proposal is not None:
            return f"the model does not explain what was seen, but {self.proposal.description}; {found}"
        if force is None and self.prediction is not None and not self.prediction.holds:
            return f"{self.prediction.description}; {found}"
        if force is None or (force.left > MOST_LEFT and not estimate.is_explained):
            return f"the model does not explain what was seen, be it for {estimate.lacks}: {found}"
        return self._lacking(force, found)

    def _lacking(self, force: Unmodelled, found: str) -> str:
        """What the motion shows that the model has not, what that would change, and what was `found`, in a sentence."""
        what = "a force that the model has not" if force.is_force else "what the model has not"
        return (
            f"the motion shows {what}, {force.description} or one like it: with it "
            f"{self._shift_in_words(force.shift)} ({force.advice}); {found}"
        )

    @property
    def half_width(self) -> float:
        """Half the widest of intervals that hold all that is wanted at once, as a share of it."""
        return self.estimate.half_width_with(self.value_covariance)

    def known(self, wanted: Parameters) -> Known:
        """What is known of the parameters that are `wanted`. One is determined that is known to a tenth of what it is;
        of an arm also to a tenth of what it may have been wrong by beforehand.
        """
        estimate, values, deviations = self.estimate, self.estimate.values, self.deviations
        low, high = estimate.interval_with(deviations)
        if estimate.extent is not None:
            nothing = np.full(len(values), np.nan)
            return Known(values, nothing, low, high, high - low <= 2.0 * COARSEST * values)
        determined = deviations <= COARSEST * wanted.sizes(values)
        systematic = self.systematic(estimate.to_values @ estimate.to_numbers)
        return Known(values, deviations, low, high, determined, systematic)

    def systematic(self, design: Array) -> Array | None:
        """Standard deviations (n) that what the model may lack adds to numbers that change with the unknowns by a
        `design` (n x nunknown); None where nothing was looked for.  Eq. 38.
        """
        if not self.forces:
            return None
        left_open = np.concatenate([each.left_open for each in self.forces], axis=1)
        return np.asarray(self.estimate.widening * np.linalg.norm(design @ left_open, axis=1))

    @property
    def interval_name(self) -> str:
        """What `low` to `high` is."""
        return interval_name(self.estimate.counts)

    def replay(self, number: int | None = None) -> Replay:
        """One of the trials as the plant showed it and as the twin at the estimate moves. `number` is that of its table
        in `estimate.residuals`; by default the first, or, where the model explains nothing, the one that its twin shows
        worst.
        """
        experiment, trials = self._behind
        if number is None:
            squares = [np.nanmean(table**2) for table in self.estimate.residuals]
            number = 0 if self.explains else int(np.argmax(squares))
        replay: Replay = experiment.replay(trials, self.estimate, number)
        return replay


def _clearest(forces: Iterable[Unmodelled]) -> Unmodelled | None:
    """What leaves least; geometry, which has many unknowns to do so with, where it leaves half of what forces do."""
    return min(forces, key=lambda each: each.left if each.is_force else 2.0 * each.left, default=None)


def _describe_counts(misfit: float, explained_below: float, counts: int) -> str:
    """What it means that so many of all `counts` differ, in a sentence."""
    if misfit < explained_below:
        return f"the model counts what was counted: all {counts:,} counts of half periods are the same"
    return f"no model was found that counts what was counted: in the best, {misfit:,.0f} of {counts:,} counts differ"


def interval_name(counts: int | None) -> str:
    """What `low` to `high` is of an estimate for which so many `counts` were compared, or none."""
    return "95 % interval" if counts is None else "extent of the models that count the same"
