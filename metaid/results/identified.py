"""What a study stands by: the identified lumps of each stage. Here, and only here, the truth meets the result."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.models import Array, lump_unit
from metaid.results.stage import Stage
from metaid.study import Problem, identifiability


def lumps_of_stage(stage: Stage) -> pd.DataFrame:
    problem, survivors = stage.problem, stage.survivors
    nominal = problem.lumps.vector
    unknown = np.full(len(nominal), np.nan)
    determined = _determined(problem)
    factor = low = high = unknown
    if survivors:
        factors = np.array([trial.factors for trial in survivors])
        values = np.array([trial.outcome.value for trial in survivors])
        found = identified_factors(problem, factors, values)
        factor, low, high = (np.where(determined, factors, np.nan) for factors in found)
    truth = problem.open_plant().true_lumps()
    true = unknown if truth is None else truth.vector_of(problem.lumps.searched, np.nan)
    identified = factor * nominal
    columns = {
        "name": problem.names,
        "unit": [lump_unit(lump) for lump in problem.names],
        "nominal": nominal,
        "factor": factor,
        "identified": identified,
        "low": low * nominal,
        "high": high * nominal,
        "true": true,
        "error": identified / np.where(true == 0.0, np.nan, true) - 1.0,
        "determined": determined,
    }
    return pd.DataFrame(columns)


def identified_factors(problem: Problem, factors: Array, values: Array) -> tuple[Array, Array, Array]:
    """What survivors with these `factors` (ntrial x nlump) and `values` (ntrial) say of each lump's factor: the one to
    stand by, and the least and largest possible, (nlump) each.
    """
    # The last of equals: a search that went on among them had a reason to, as DINOIP, which ends just before the fall.
    best = len(values) - 1 - int(values[::-1].argmin())
    # The paper's "range of possible values": trials that the measure cannot tell from the best.
    equal = factors[values <= problem.as_good_as(float(values[best]))]
    told = equal.mean(axis=0) if problem.measure.is_noisy else factors[best]
    return told, equal.min(axis=0), equal.max(axis=0)


def _determined(problem: Problem) -> NDArray[np.bool_]:
    """Which lumps the trials can tell (nlump): by the sensitivity of the pushes, else by the measure."""
    if problem.measure.sees_coriolis:
        return np.array(identifiability(problem).determined)
    return np.array([problem.measure.determines(lump) for lump in problem.names])
