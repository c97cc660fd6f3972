"""The table of lumps that follows from the best trial of each stage of a study."""

from __future__ import annotations

import numpy as np
import pandas as pd

from metaid.models import Array, lump_unit
from metaid.results.best import factor_range, identified_factors
from metaid.results.snapshot import Snapshot, Stage
from metaid.study import COARSEST, Problem, identifiability


def best_table(snapshot: Snapshot) -> pd.DataFrame:
    """One row a lump of all stages, as `lumps_frame` has them, by the best trial of its stage."""
    return pd.concat([_lumps_of(stage) for stage in snapshot.stages], ignore_index=True)


def _lumps_of(stage: Stage) -> pd.DataFrame:
    problem, survivors = stage.problem, stage.survivors
    nominal = problem.lumps.vector
    unknown = np.full(len(nominal), np.nan)
    resolution = _resolution(problem)
    determined = resolution <= COARSEST
    factor = low = high = unknown
    if survivors:
        factors = np.array([trial.factors for trial in survivors])
        values = np.array([trial.outcome.value for trial in survivors])
        found = identified_factors(problem, factors, values), *factor_range(problem, factors, values, resolution)
        determined &= found[2] - found[1] <= 2.0 * COARSEST * found[0]
        factor, low, high = (np.where(determined, each, np.nan) for each in found)
    truth = problem.open_plant().true_lumps()  # here, and only here, the truth meets the result
    true = unknown if truth is None else truth.vector_of(problem.lumps.searched, np.nan)
    identified = factor * nominal
    columns = {
        "name": problem.names,
        "unit": [lump_unit(lump) for lump in problem.names],
        "nominal": nominal,
        "factor": factor,
        "identified": identified,
        "sd": unknown,
        "low": low * nominal,
        "high": high * nominal,
        "true": true,
        "error": identified / np.where(true == 0.0, np.nan, true) - 1.0,
        "determined": determined,
    }
    return pd.DataFrame(columns)


def _resolution(problem: Problem) -> Array:
    """How well the trials can find each factor (nlump); inf where the pushes or the measure do not show the lump."""
    resolution = identifiability(problem).resolution
    return np.where(problem.measure.determined(problem.lumps), resolution, np.inf)


def largest_error(lumps: pd.DataFrame) -> float | None:
    """The largest relative error of a determined lump in a table of `lumps`; None where one of them is not known, or no
    lump is determined.
    """
    errors = lumps["error"][lumps["determined"]].abs()
    return None if errors.empty or errors.isna().any() else float(errors.max())
