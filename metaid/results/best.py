"""Which trial a study's result is taken from, and which trials are as good as that one.

Everything that shows a result asks here: `study show`, its JSON, frames, figures, the report, the dashboard's note,
`validate` and films. So they cannot disagree where several trials have the same least value.
"""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from metaid.models import Array
from metaid.store import Trial
from metaid.study import Problem


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


def first_of_best(survivors: Sequence[Trial]) -> Trial:
    """The trial that the law of the second stage was made from: the first with the least value.

    A run keeps the first of equals (`study/progress.py`) and begins the second stage with it. The trials of that stage
    belong to this law, so nothing else may be used to describe them.
    """
    return min(survivors, key=lambda trial: trial.outcome.value)


def identified_factors(problem: Problem, factors: Array, values: Array) -> tuple[Array, Array, Array]:
    """The factor of each lump that follows from a stage's survivors, with its range.

    Args:
        problem: the stage.
        factors: of the survivors' lumps (ntrial x nlump), in the order in which they were evaluated.
        values: of the measure (ntrial), in its unit.

    Returns:
        The identified factor of each lump, and its least and largest possible one, (nlump) each. The range is that of
        the trials that the measure cannot tell from the best. Identified is the best trial itself; of a noisy measure,
        whose best trial is only the luckiest, it is the mean of that range's trials.
    """
    best = best_index(values)
    # The paper's "range of possible values".
    equal = factors[values <= problem.as_good_as(float(values[best]))]
    identified = equal.mean(axis=0) if problem.measure.is_noisy else factors[best]
    return identified, equal.min(axis=0), equal.max(axis=0)
