"""What all trials of a study of an arm say together, as it is kept with the study."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from metaid.estimation import Approximation, HeldOut
from metaid.estimation.arms import ArmEstimate
from metaid.models import Array
from metaid.models.tree import possible_bodies
from metaid.store import Trial
from metaid.study.arms import ArmProblem
from metaid.study.estimates.chain import interval_name, worst_shown
from metaid.study.estimates.making import CLOSE, first_enough
from metaid.study.identifiability import COARSEST

if TYPE_CHECKING:
    from metaid.estimation import Replay
    from metaid.estimation.arms import ArmExperiment, SeenArmTrial


@dataclass(frozen=True)
class ArmFound:
    """An estimate, and all that is said of it.

    Attributes:
        estimate: what the trials say.
        trials: how many it is made of.
        seen: makes the experiment and these trials, as that has them.
        held_out: how well fits to some pushes predict the others; None where the estimate explains what was seen to
            the noise, and where no push can be left out.
        known_from: how many of the first trials were enough to know every base parameter as well as all of them.
    """

    estimate: ArmEstimate
    trials: int
    seen: Callable[[], tuple[ArmExperiment, tuple[SeenArmTrial, ...]]] = field(compare=False, repr=False)
    held_out: HeldOut | None = None
    known_from: int | None = None

    @property
    def explains(self) -> bool:
        """Whether the model explains what was seen."""
        return self.estimate.is_explained

    @property
    def description(self) -> str:
        """How well the model explains what was seen, in a sentence."""
        found = f"misfit {self.estimate.misfit:.3g} (explained: below {self.estimate.explained_below:.3g})"
        if self.explains:
            return f"the model explains what was seen: {found}"
        return (
            "the model does not explain what was seen, be it for springs, play, torques that come late or are cut off, "
            f"or wrong frames: {found}"
        )

    @cached_property
    def approximation(self) -> Approximation | None:
        """What the estimate is worth where it does not explain what was seen to the noise, base parameter by base
        parameter; None where it does, and where no push can be left out.
        """
        estimate, held, prior = self.estimate, self.held_out, self.estimate.searched.prior
        if held is None:
            return None
        values, beforehand = estimate.values, np.sqrt(np.diag(prior.covariance))
        return Approximation(
            replace(held, unknowns=estimate.searched.values(held.unknowns)),
            estimate.misfit,
            estimate.residuals,
            prior.nominal.names,
            estimate.value_deviations,
            np.zeros(len(values)),
            COARSEST * np.maximum(np.abs(values), beforehand),
            possible_bodies(prior, values) is not None,
        )

    @property
    def deviations(self) -> Array:
        """Standard deviation of each base parameter (nbase), in its unit."""
        return self.estimate.value_deviations if self.approximation is None else self.approximation.deviations

    @property
    def covariance(self) -> Array:
        """Of the base parameters (nbase x nbase)."""
        wider = self.deviations / self.estimate.value_deviations
        return np.asarray(self.estimate.value_covariance * np.outer(wider, wider), dtype=np.float64)

    @property
    def interval_name(self) -> str:
        """What `low` to `high` of the base parameters is."""
        return interval_name(None)

    def replay(self) -> Replay:
        """A trial as the plant showed it, and as the twin at the estimate moves: see `worst_shown`."""
        experiment, trials = self.seen()
        number = worst_shown(self.estimate.residuals, self.explains)
        return experiment.replay(trials, self.estimate, number)


def watched_arm_trials(
    problem: ArmProblem, trials: Sequence[Trial]
) -> tuple[ArmExperiment | None, tuple[SeenArmTrial, ...]]:
    """The experiment of the study that `problem` is, None where none can be made, and its `trials` as that has them."""
    shown = [each for each in trials if each.outcome.windows is not None or each.outcome.readings is not None]
    experiment = problem.experiment() if shown else None
    if experiment is None:
        return None, ()
    seen = (experiment.trial(each.factors, each.outcome) for each in shown)
    return experiment, tuple(trial for trial in seen if trial is not None)


def arm_estimate(problem: ArmProblem, trials: Sequence[Trial]) -> ArmFound | None:
    """The estimate from all `trials` of the study that `problem` is; None where nothing can be made of them."""
    with threadpool_limits(1):
        experiment, watched = watched_arm_trials(problem, trials)
        if experiment is None or not watched:
            return None
        # From where the first trials lead, all of them lead on in a step or two.
        few = watched[: experiment.probes]
        probed = experiment.estimate(few, thorough=len(few) == len(watched))
        estimate = probed if len(few) == len(watched) else experiment.estimate(watched, probed)
        if estimate is None:
            return None
        held_out = None if estimate.is_explained else experiment.held_out(watched, estimate)
        known_from = _known_from(estimate, probed, experiment, watched)
    return ArmFound(estimate, len(watched), lambda: (experiment, watched), held_out, known_from)


def _known_from(
    estimate: ArmEstimate, probed: ArmEstimate | None, experiment: ArmExperiment, watched: tuple[SeenArmTrial, ...]
) -> int | None:
    """How many of the first trials were enough for an estimate of all; None where it explains nothing.

    Args:
        estimate: of all trials.
        probed: of the first of them alone that the experiment needs for one.
        experiment: of the study.
        watched: the trials.
    """
    if not estimate.is_explained:
        return None
    reach = CLOSE * experiment.searched.spread  # of every unknown's deviation beforehand

    def is_enough(count: int) -> bool:
        early: ArmEstimate | None = estimate
        if count < len(watched):
            some = watched[:count]
            early = probed if count == experiment.probes else experiment.estimate(some, probed, False)
        return early is not None and np.abs(early.unknowns - estimate.unknowns).max() <= reach

    return first_enough(experiment.probes, len(watched), is_enough)
