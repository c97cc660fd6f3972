"""A study of an arm as the DB has it at one moment, and the estimate from its trials."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from metaid.models import Array
from metaid.models.tree import Tree, possible_bodies
from metaid.results.best import best_trial
from metaid.results.estimates import first_enough, interval_name, worst_shown
from metaid.results.snapshot import surviving
from metaid.store import ForeignTrial, Trial
from metaid.study import COARSEST, ArmProblem, ArmSpec

if TYPE_CHECKING:
    from metaid.estimation import Approximation, Replay
    from metaid.estimation.arms import ArmEstimate, ArmExperiment, SeenArmTrial

CLOSE = 1e-3  # of every unknown's deviation beforehand: so near its last value an estimate was there


@dataclass(frozen=True)
class ArmFound:
    """An `estimate`, the `experiment` that it is of, and the trials that were `watched` for it; and the estimate of the
    first of them alone that the experiment needs for one, `probed`, from which it began.
    """

    estimate: ArmEstimate
    experiment: ArmExperiment
    watched: tuple[SeenArmTrial, ...]
    probed: ArmEstimate | None

    @property
    def trials(self) -> int:
        """How many trials it was made of."""
        return len(self.watched)

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
        from metaid.estimation import Approximation  # loads numba

        estimate, belief = self.estimate, self.experiment.searched.belief
        if self.explains:
            return None
        with threadpool_limits(1):
            held = self.experiment.held_out(self.watched, estimate)
        if held is None:
            return None
        values, beforehand = estimate.values, np.sqrt(np.diag(belief.covariance))
        return Approximation(
            replace(held, unknowns=estimate.searched.values(held.unknowns)),
            estimate.misfit,
            estimate.residuals,
            belief.nominal.names,
            estimate.value_deviations,
            np.zeros(len(values)),
            COARSEST * np.maximum(np.abs(values), beforehand),
            possible_bodies(belief, values) is not None,
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

    @cached_property
    def known_from(self) -> int | None:
        """How many of the first trials were enough to know every base parameter as well as all of them."""
        if not self.explains:
            return None
        reach = CLOSE * self.experiment.searched.spread

        def is_enough(count: int) -> bool:
            early: ArmEstimate | None = self.estimate
            if count < self.trials:
                probed, some = self.probed, self.watched[:count]
                early = probed if count == self.experiment.probes else self.experiment.estimate(some, probed, False)
            return early is not None and np.abs(early.unknowns - self.estimate.unknowns).max() <= reach

        with threadpool_limits(1):
            return first_enough(self.experiment.probes, self.trials, is_enough)

    @property
    def interval_name(self) -> str:
        """What `low` to `high` of the base parameters is."""
        return interval_name(None)

    def replay(self) -> Replay:
        """A trial as the plant showed it, and as the twin at the estimate moves: see `worst_shown`."""
        number = worst_shown(self.estimate.residuals, self.explains)
        return self.experiment.replay(self.watched, self.estimate, number)


@dataclass(frozen=True)
class ArmSnapshot:
    """A study's `name`, its settings and all its `trials`; the `foreign` ones, which metaid did not write; and with how
    many trials its search `ended`, None where no run got so far.
    """

    name: str
    spec: ArmSpec
    trials: list[Trial]
    foreign: tuple[ForeignTrial, ...] = ()
    ended: int | None = None

    @property
    def is_finished(self) -> bool:
        """Whether nothing is left to do: all trials of the study are there, or its search stopped before."""
        return len(self.trials) >= self.spec.study.trials or len(self.trials) == self.ended

    @cached_property
    def problem(self) -> ArmProblem:
        """What follows from its settings."""
        return ArmProblem(self.spec)

    @cached_property
    def estimate(self) -> ArmFound | None:
        """What all trials say together; None where nothing can be made of them."""
        shown = [each for each in self.trials if each.outcome.windows is not None or each.outcome.readings is not None]
        experiment = self.problem.experiment() if shown else None
        if experiment is None:
            return None
        with threadpool_limits(1):
            seen = (experiment.trial(each.factors, each.outcome) for each in shown)
            watched = tuple(trial for trial in seen if trial is not None)
            # From where the first trials lead, all of them lead on in a step or two.
            few = watched[: experiment.probes]
            probed = experiment.estimate(few, thorough=len(few) == len(watched)) if watched else None
            estimate = probed if len(few) == len(watched) else experiment.estimate(watched, probed)
        return None if estimate is None else ArmFound(estimate, experiment, watched, probed)

    @property
    def why_no_estimate(self) -> str:
        """Why there is none."""
        if not self.trials:
            return "it has no trial yet"
        if not self.spec.study.estimate.enabled:
            return "[estimate] enabled is false"
        return "no arm near the nominal one shows what the trials showed"

    @cached_property
    def best(self) -> Trial | None:
        """The best of the trials that did not fall; None where all did."""
        survivors = surviving(self.trials)
        return best_trial(survivors) if survivors else None

    @cached_property
    def truth(self) -> Tree | None:
        """The true arm, where it is known: here, and only here, it meets the result."""
        plant = self.problem.open_plant()
        return plant.tree if plant.true_parameters() is not None else None
