"""What all trials of a study say together: the estimate of its lumps, with intervals, by whichever sampler."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from metaid.models import Array, kind_of, lump_names, lump_unit
from metaid.store import Trial
from metaid.study import COARSEST, Problem

if TYPE_CHECKING:
    from metaid.estimation import Estimate, Experiment, WatchedTrial

MOST_TRIALS = 32  # that an estimate is made of; without noise more add nothing but computing
FIRST_TRIALS = 12  # of which it is looked for how early the estimate was there
CLOSE = 1e-3  # of every lump: so near its last value an estimate was there
DEVIATIONS = 1.96  # of a normal distribution, to either side, hold 95 %


@dataclass(frozen=True)
class StudyEstimate:
    """An `estimate`, the `experiment` that it is of, the number of `trials` that it was made of, and how many of the
    first were enough to know every lump to CLOSE, None where it took more than FIRST_TRIALS.
    """

    estimate: Estimate
    experiment: Experiment
    trials: int
    known_from: int | None

    @property
    def explains(self) -> bool:
        """Whether the model explains what was seen."""
        return self.experiment.is_explained(self.estimate)


def study_estimate(problem: Problem, tried: Sequence[Trial]) -> StudyEstimate | None:
    """The estimate from the trials that were `tried` in a study's first stage, which `problem` is; None where there is
    none to be made.
    """
    shown = [(each.factors, each.outcome.windows) for each in tried if each.outcome.windows is not None]
    experiment = problem.experiment() if shown else None
    if experiment is None:
        return None
    trials = [experiment.trial(factors, windows) for factors, windows in shown[:MOST_TRIALS] if windows is not None]
    estimate = experiment.estimate(trials)
    if estimate is None:
        return None
    return StudyEstimate(estimate, experiment, len(trials), _known_from(experiment, trials, estimate))


def _known_from(experiment: Experiment, trials: Sequence[WatchedTrial], estimate: Estimate) -> int | None:
    """How many of the first trials gave every lump within CLOSE of the `estimate` from all of them."""
    for count in range(1, min(len(trials), FIRST_TRIALS) + 1):
        early = experiment.estimate(trials[:count])
        if early is not None and np.abs(early.log_factors - estimate.log_factors).max() <= CLOSE:
            return count
    return None


def estimate_table(problem: Problem, found: StudyEstimate | None) -> pd.DataFrame:
    """One row a lump, those of inertia included, as `lumps_frame` has them; NaN where nothing was found."""
    kinds = problem.estimated_kinds
    names = lump_names(problem.nominal.nlink, kinds)
    nominal = problem.nominal.lumps_of(kinds).vector_of(kinds)
    nothing = np.full(len(names), np.nan)
    factor, deviation = nothing, nothing
    if found is not None and found.explains:
        factor = found.estimate.lumps.vector_of(kinds) / nominal
        deviation = _deviations(names, found.estimate)
    truth = problem.open_plant().true_lumps()  # the truth meets the result in reports alone
    true = nothing if truth is None else truth.vector_of(kinds, np.nan)
    determined = deviation <= COARSEST
    told, spread = np.where(determined, factor, np.nan), DEVIATIONS * np.where(determined, deviation, np.nan)
    columns = {
        "name": names,
        "unit": [lump_unit(lump) for lump in names],
        "nominal": nominal,
        "factor": told,
        "identified": told * nominal,
        "sd": told * nominal * deviation,
        "low": told * nominal * np.exp(-spread),
        "high": told * nominal * np.exp(spread),
        "true": true,
        "error": told * nominal / np.where(true == 0.0, np.nan, true) - 1.0,
        "determined": determined,
    }
    return pd.DataFrame(columns)


def _deviations(names: list[str], estimate: Estimate) -> Array:
    """The standard deviation of each lump, as a share of it. With exact lengths a_ij is as well known as μ_j."""
    known = dict(zip(estimate.names, estimate.deviations.tolist(), strict=True))
    own = [
        name if name in known or kind_of(name) != "coriolis" else f"gravity_{name.rpartition('_')[2]}" for name in names
    ]
    return np.array([known[name] for name in own])


def summarized_estimate(problem: Problem, found: StudyEstimate | None) -> dict[str, Any] | None:
    """The estimate as `study show --json` has it beside the best trial; None where there is none."""
    if found is None:
        return None
    lumps = estimate_table(problem, found)
    errors = lumps["error"].abs()
    return {
        "misfit": found.estimate.misfit,
        "explains": found.explains,
        "trials": found.trials,
        "known_from": found.known_from,
        "max_error": None if errors.isna().any() else float(errors.max()),
        "lumps": [
            {key: None if isinstance(value, float) and np.isnan(value) else value for key, value in row.items()}
            for row in lumps.to_dict("records")
        ],
    }
