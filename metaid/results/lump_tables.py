"""The tables of what was found: lumps or base parameters by the best trial or by the estimate, and faults."""

from __future__ import annotations

import numpy as np
import pandas as pd

from metaid.models import DEVIATIONS
from metaid.plant import fault_names, fault_unit, true_faults
from metaid.results.best import known_by_best
from metaid.results.stored import StoredStudy
from metaid.study import Known, Parameters, Problem

NOTHING = 1e-9  # of what a base parameter may have been wrong by: an error is no share of less


def best_table(study: StoredStudy) -> pd.DataFrame:
    """One row a parameter that was sought, as `lumps_frame` has them, by the best trial."""
    problem = study.problem
    return _rows(problem, problem.robot.sought, known_by_best(problem, study.survivors))


def estimate_table(study: StoredStudy, is_result: bool) -> pd.DataFrame:
    """One row a parameter that is estimated, as `lumps_frame` has them; NaN where there is no estimate. There are
    intervals where it `is_result`: it explains what was seen, or is approximate.
    """
    problem, found, wanted = study.problem, study.estimate, study.problem.robot.estimated
    if found is None:
        return _rows(problem, wanted, Known.alone(np.full(len(wanted.names), np.nan)))
    return _rows(problem, wanted, found.known(wanted) if is_result else Known.alone(found.estimate.values))


def _rows(problem: Problem, wanted: Parameters, known: Known) -> pd.DataFrame:
    """What is `known` of what is `wanted` of a study, beside the truth."""
    true = problem.robot.true_values(wanted)  # here, and only here, the truth meets the result
    least = 0.0 if wanted.deviations is None else NOTHING * wanted.deviations
    columns = {
        "name": wanted.names,
        "unit": wanted.units,
        "nominal": wanted.nominal,
        "factor": known.values / np.where(wanted.nominal == 0.0, np.nan, wanted.nominal),
        "identified": known.values,
        "sd": known.deviations,
        "low": known.low,
        "high": known.high,
        "true": true,
        "error": known.values / np.where(np.abs(true) <= least, np.nan, true) - 1.0,
        "determined": known.determined,
    }
    if wanted.expressions is not None:
        columns["expression"] = wanted.expressions
    if known.systematic is not None:
        columns["sd_systematic"] = known.systematic
    return pd.DataFrame(columns)


def largest_error(lumps: pd.DataFrame) -> float | None:
    """The largest relative error of a determined lump in a table of `lumps`; None where one of them is not known, or no
    lump is determined. Of base parameters it says nothing: one may be next to nothing, though all is well known.
    """
    if "expression" in lumps:
        return None
    errors = lumps["error"][lumps["determined"]].abs()
    return None if errors.empty or errors.isna().any() else float(errors.max())


def fault_table(study: StoredStudy, is_result: bool) -> pd.DataFrame:
    """One row a fault that was searched or taken up, see `[estimate] faults`: `name`, `unit`, `identified`, `sd`, `low`
    and `high` of the 95 % interval, `true`, `error`, which is the difference of the two, and whether it is
    `determined`. NaN as in `estimate_table`; no row where no fault was searched.
    """
    problem, found, kinds = study.problem, study.estimate, study.spec.study.estimate.searched_faults
    if found is not None and found.estimate.faults is not None:
        kinds = found.estimate.faults.searched.kinds
    names = fault_names(kinds, len(problem.spec.joints), problem.robot.unknowns.tilts)
    nothing = np.full(len(names), np.nan)
    # Here, and only here, the truth meets the result.
    true = true_faults(problem.robot.plant(), kinds) if problem.spec.is_simulated else nothing
    value, deviation, determined = nothing, nothing, np.zeros(len(names), dtype=np.bool_)
    if found is not None and (faults := found.estimate.faults) is not None:
        value = faults.values
        if is_result:
            determined, deviation = faults.determined, found.estimate.widening * faults.deviations
    columns = {
        "name": names,
        "unit": [fault_unit(name) for name in names],
        "identified": value,
        "sd": deviation,
        "low": value - DEVIATIONS * deviation,
        "high": value + DEVIATIONS * deviation,
        "true": true,
        "error": value - true,
        "determined": determined,
    }
    return pd.DataFrame(columns)
