"""Which trial a study's result is taken from, and which trials are as good as that one.

Everything that shows a result asks here: `study show`, its JSON, frames, figures, the report, the dashboard's note,
`validate` and films. So they cannot disagree where several trials have the same least value.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from metaid.models import Array
from metaid.store import Trial
from metaid.study import Problem

NOMINAL_SENSITIVITY = 1.5  # by how much ranges by the nominal model's sensitivity are widened: it is not the plant's


def best_index(values: Array) -> int:
    """The position of the best of survivors with these `values` (ntrial), in the order in which they were evaluated.

    It is the last of those with the least value. A sampler that goes on among equal values has a reason to: DINOIP
    steps down until the next step falls, so its last survivor is the nearest to the truth.
    """
    return len(values) - 1 - int(values[::-1].argmin())


def best_trial(survivors: Sequence[Trial]) -> Trial:
    """The best of these `survivors`, of which there is one at least."""
    best = min(trial.outcome.value for trial in survivors)
    return next(trial for trial in reversed(survivors) if trial.outcome.value == best)


def best_rows(survivors: pd.DataFrame, count: int) -> pd.DataFrame:
    """The `count` best rows of a frame of `survivors`, the best first; of equals the later ones are kept."""
    ordered = survivors.iloc[::-1].sort_values("value", kind="stable")
    best: pd.DataFrame = ordered.iloc[:count]
    return best


def identified_factors(problem: Problem, factors: Array, values: Array) -> Array:
    """The factor of each lump (nlump) that follows from a study's survivors, with `factors` (ntrial x nlump) and
    `values` of the measure (ntrial), in the order in which they were evaluated.

    It is the best trial's; of a noisy measure, whose best trial is only the luckiest, it is the mean of the trials that
    cannot be told from it.
    """
    best = best_index(values)
    if problem.measure.is_noisy:
        mean: Array = factors[values <= problem.as_good_as(float(values[best]))].mean(axis=0)
        return mean
    identified: Array = factors[best]
    return identified


def factor_range(problem: Problem, factors: Array, values: Array, resolution: Array) -> tuple[Array, Array]:
    """The least and the largest factor of each lump, (nlump) each, that cannot be told from the identified one.

    It is the range of the trials that the measure cannot tell from the best, which the paper calls the range of
    possible values. They are a sample, and often a small one. Where the measure sees all lumps, the range is at least
    as wide as the ellipsoid of the factors whose value is as small as theirs, by the nominal model's sensitivity
    (Eq. 14).

    Args:
        problem: of the study.
        factors: of the survivors' lumps (ntrial x nlump), in the order in which they were evaluated.
        values: of the measure (ntrial), in its unit.
        resolution: of each factor (nlump) where the best value is the measure's resolution.
    """
    limit = problem.as_good_as(float(values.min()))
    equal = factors[values <= limit]
    low, high = equal.min(axis=0), equal.max(axis=0)
    if problem.measure.sees_coriolis:
        identified = identified_factors(problem, factors, values)
        reach = NOMINAL_SENSITIVITY * resolution * limit / problem.resolution
        low, high = np.minimum(low, identified - reach), np.maximum(high, identified + reach)
    return low, high
