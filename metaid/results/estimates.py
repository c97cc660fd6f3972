"""What all trials of a study say together: the estimate of its lumps, with intervals, by whichever sampler."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from threadpoolctl import threadpool_limits

from metaid.episode import QUANTITIES, Episode, Outcome
from metaid.models import Array, half_width
from metaid.store import Trial
from metaid.study import COARSEST, MOST_TRIALS, Problem

if TYPE_CHECKING:
    from metaid.estimation import Approximation, Estimate, Experiment, Proposal, Replay, SeenTrial, TakenUp, Unmodelled

FIRST_TRIALS = 12  # of which it is looked for how early the estimate was there
FEW_TRIALS = 3
MOST_SHOWN = 7  # numbers of trials, from each of which an estimate is shown
MOST_LEFT = 0.3  # of the squares of a misfit: a force that leaves more of it is not what is missing
CLOSE = 1e-3  # of every lump: so near its last value an estimate was there


@dataclass(frozen=True)
class StudyEstimate:
    """An `estimate`, the `experiment` that it is of, and the trials that were `watched` for it; the last `by_others` of
    them are not metaid's own. What speaks for faults that were `taken_up`; None where none were.
    """

    estimate: Estimate
    experiment: Experiment
    watched: tuple[SeenTrial, ...]
    by_others: int = 0
    taken_up: TakenUp | None = None

    @cached_property
    def known_from(self) -> int | None:
        """How many of the first trials were enough to know every lump to CLOSE; None where it took more than
        FIRST_TRIALS, and where counts are compared, which every trial adds to.
        """
        if not self.explains or self.estimate.counts is not None:
            return None

        def is_enough(count: int) -> bool:
            early = self.estimate if count == self.trials else self.experiment.estimate(self.watched[:count])
            return early is not None and np.abs(early.log_factors - self.estimate.log_factors).max() <= CLOSE

        with threadpool_limits(1):  # fewer than the probes cannot tell all
            return first_enough(self.experiment.probes, min(self.trials, FIRST_TRIALS), is_enough)

    @cached_property
    def growth(self) -> tuple[list[int], list[Estimate]]:
        """How many of the first trials there are, at most MOST_SHOWN different numbers of them, and the estimate from
        these; those that no estimate explains are left out. Each begins where the one before ended.
        """
        numbers = np.unique(np.geomspace(1.0, self.trials, min(self.trials, MOST_SHOWN)).round().astype(int))
        counts, estimates, early = [], [], None
        with threadpool_limits(1):
            for count in numbers[numbers >= self.experiment.probes].tolist():
                whole, thorough = count == self.trials, count <= FEW_TRIALS
                early = self.estimate if whole else self.experiment.estimate(self.watched[:count], early, thorough)
                if early is not None and early.is_explained:
                    counts.append(count)
                    estimates.append(early)
        return counts, estimates

    @property
    def trials(self) -> int:
        """How many trials it was made of."""
        return len(self.watched)

    @cached_property
    def _forces(self) -> list[Unmodelled]:
        with threadpool_limits(1):
            return self.experiment.unmodelled(self.watched, self.estimate)

    @property
    def unmodelled(self) -> Unmodelled | None:
        """The force that the model has not and that the trials show best; None where they show none."""
        return min((each for each in self._forces if each.is_seen), key=lambda each: each.left, default=None)

    @cached_property
    def hinted(self) -> Unmodelled | None:
        """The force that the model has not and that the trials hint at best, though noise may look like it."""
        return min((each for each in self._forces if each.is_hinted), key=lambda each: each.left, default=None)

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
        from metaid.estimation import Approximation, has_mass, numbered_joints  # loads numba

        estimate = self.estimate
        if estimate.is_explained or estimate.counts is not None:
            return None
        with threadpool_limits(1):
            held = self.experiment.held_out(self.watched, estimate)
        if held is None:
            return None
        force = self.hinted
        count = len(estimate.names)
        return Approximation(
            held,
            estimate.misfit,
            estimate.residuals,
            numbered_joints(estimate.residuals[0].shape[1]),
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

    @cached_property
    def proposal(self) -> Proposal | None:
        """Faults that would explain what the estimate does not, were they searched; None where none does."""
        if self.estimate.is_explained:
            return None
        with threadpool_limits(1):
            return self.experiment.proposed(self.watched, self.estimate)

    @property
    def reasons(self) -> list[str]:
        """What the study itself did to explain what was seen: a sentence, where it took up faults."""
        return [] if self.taken_up is None else [self.taken_up.description]

    @property
    def provisos(self) -> list[str]:
        """What must not be there for the lumps to be right, for the trials could not tell: sentences that name it."""
        said = []
        for force in self._forces:
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

    def values(self, estimate: Estimate) -> Array:
        """The lumps (nlump) of an `estimate`."""
        return estimate.lumps.vector_of(self.experiment.unknowns.kinds)

    def replay(self, number: int | None = None) -> Replay:
        """One of the trials as the plant showed it and as the twin at the estimate moves. `number` is that of its table
        in `estimate.residuals`; by default see `worst_shown`.
        """
        if number is None:
            number = worst_shown(self.estimate.residuals, self.explains)
        return self.experiment.replay(self.watched, self.estimate, number)


def _most_moved(estimate: Estimate, force: Unmodelled) -> tuple[str, str]:
    """The unknown of an `estimate` that a `force` would change most, and by how much, in words."""
    moved = int(np.argmax(np.abs(force.shift)))
    by = 100.0 * float(np.expm1(force.shift[moved]))
    return estimate.names[moved], f"{abs(by):.2g} % {'larger' if by > 0.0 else 'smaller'}"


def first_enough(fewest: int, most: int, is_enough: Callable[[int], bool]) -> int | None:
    """The least number from `fewest` to `most` that is enough; None where `most` is not.

    What is enough is taken to stay so. It is looked for in steps that double, then by halves: an estimate from too few
    trials may take seconds to explain nothing.
    """
    if fewest > most:
        return None
    too_few, enough, step = fewest - 1, fewest, 1
    while not is_enough(enough):
        if enough == most:
            return None
        too_few, enough, step = enough, min(enough + step, most), 2 * step
    while enough - too_few > 1:
        middle = (too_few + enough) // 2
        too_few, enough = (too_few, middle) if is_enough(middle) else (middle, enough)
    return enough


def worst_shown(residuals: Sequence[Array], explains: bool) -> int:
    """The number of the trial that is worth a look, by the `residuals` of each (npush x njoint): the first, or, where
    the model explains nothing, the one that its twin shows worst.
    """
    return 0 if explains else int(np.argmax([np.nanmean(table**2) for table in residuals]))


def has_motion_of(episode: Episode, outcome: Outcome) -> bool:
    """Whether the windows or the readings of an `outcome` are of such an `episode`."""
    npush, njoint = episode.pushes.shape
    if episode.readings_steps:
        read = outcome.readings
        return read is not None and read.angles.shape == (npush, episode.readings_steps + 1, njoint)
    shown, ends = outcome.windows, episode.window_ends
    same = shown is not None and shown.motion.shape == (npush, len(ends), QUANTITIES, njoint)
    return same and shown is not None and tuple(shown.ends.tolist()) == ends


def study_estimate(problem: Problem, tried: Sequence[Trial], by_others: Sequence[Trial] = ()) -> StudyEstimate | None:
    """The estimate from the trials of a study that were `tried`, whose `problem` is given, and after these from those
    that others had evaluated; at most MOST_TRIALS of each. None where there is none to be made.
    """
    shown = [each for each in tried if each.outcome.windows is not None or each.outcome.readings is not None]
    own, others = shown[:MOST_TRIALS], by_others[:MOST_TRIALS]
    shown = [*own, *others]
    experiment = problem.experiment() if shown else None
    if experiment is None:
        return None
    # At these sizes BLAS threads cost far more than they give.
    with threadpool_limits(1):
        seen = (experiment.trial(each.factors, each.outcome) for each in shown)
        trials = tuple(trial for trial in seen if trial is not None)
        return estimate_of(experiment, trials, problem.goes_by_estimate, len(others))


def estimate_of(
    experiment: Experiment, trials: tuple[SeenTrial, ...], is_probed: bool, by_others: int = 0
) -> StudyEstimate | None:
    """The estimate from all `trials` of an `experiment`; None where there is none to be made.

    Args:
        experiment: of the study.
        trials: as the experiment has them.
        is_probed: whether the first of them are the probes of a sampler. An estimate is better begun from that of the
            probes alone than from the nominal model, for squares of a motion that nearly coasts carry no sign.
        by_others: how many of the last trials are not metaid's own.
    """
    probes = trials[: experiment.probes] if is_probed and len(trials) > experiment.probes else ()
    estimate = experiment.estimate(trials, experiment.estimate(probes) if probes else None)
    if estimate is None:
        return None
    searching, estimate, taken_up = experiment.taken_up(trials, estimate)
    return StudyEstimate(estimate, searching, trials, by_others, taken_up)


def why_no_estimate(problem: Problem, tried: Sequence[Trial]) -> str:
    """Why there is no estimate from the trials that were `tried` in the study of this `problem`."""
    if not problem.spec.study.estimate.enabled:
        return "[estimate] enabled is false"
    if not problem.can_be_estimated:
        return "its episodes keep no windows of motion"
    if not tried:
        return "it has no trial yet: run it first"
    windows = [each.outcome.windows.seen for each in tried if each.outcome.windows is not None]
    readings = [each.outcome.readings.steps for each in tried if each.outcome.readings is not None]
    if not windows and not readings:
        return f"no trial in the DB has {'readings' if problem.keeps_readings else 'windows of its motion'}"
    if not any(each.any() for each in (*windows, *readings)):
        return "every trial fell within its shortest window"
    return "the twin cannot follow these trials from any chain near the nominal one"


def interval_name(counts: int | None) -> str:
    """What `low` to `high` is of an estimate for which so many `counts` were compared, or none."""
    return "95 % interval" if counts is None else "extent of the models that count the same"


def _describe_counts(misfit: float, explained_below: float, counts: int) -> str:
    """What it means that so many of all `counts` differ, in a sentence."""
    if misfit < explained_below:
        return f"the model counts what was counted: all {counts:,} counts of half periods are the same"
    return f"no model was found that counts what was counted: in the best, {misfit:,.0f} of {counts:,} counts differ"


def describe_trials(shown: dict[str, Any], total: int) -> str:
    """Which of the `total` trials of a study the estimate in its `summary` is made of, and which of others."""
    others = shown.get("by_others", 0)
    count = shown["trials"] - others
    if not count:
        return f"{others} trials of others"
    if count == 1:
        text = "the first trial" if total > 1 else "one trial"
    else:
        text = f"all {count} trials" if count == total else f"the first {count} trials"
    return f"{text} and {others} of others" if others else text


def describe_known_from(shown: dict[str, Any], total: int) -> str:
    """How early the estimate in a `summary` was there, of `total` trials of the study."""
    total += shown.get("by_others", 0)
    if shown["counts"] is not None:
        return "every trial narrows the set of models"
    known, first = shown["known_from"], min(FIRST_TRIALS, shown["trials"])
    if known is None:
        return f"the first {first} of {total} trials were not enough to know every lump to {CLOSE:.1%}"
    which = "the first" if known == 1 else f"the first {known}"
    return f"every lump was known to {CLOSE:.1%} after {which} of {total} trials"


class Approximated(Protocol):
    """An estimate of a chain or of an arm."""

    @property
    def approximation(self) -> Approximation | None:
        """What it is worth where it does not explain what was seen to the noise."""


def approximation_rows(found: Approximated, verdict: str) -> dict[str, Any]:
    """What pushes that were left out say of an estimate that was `found`, as `study show --json` has it under
    `estimate`; nothing where the `verdict` did not ask them.
    """
    worth = found.approximation if verdict in ("approximate", "not found") else None
    return {} if worth is None else worth.summary()
