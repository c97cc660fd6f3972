"""The table of lumps that follows from the best trial of a study, and that of an estimate, with that of the faults
that it searched.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.models import DEVIATIONS, Array, lump_names, lump_unit
from metaid.plant import MujocoPlant, fault_names, fault_unit, true_faults
from metaid.results.best import factor_range, identified_factors
from metaid.results.snapshot import Snapshot
from metaid.study import COARSEST, Problem, identifiability_by_measure
from metaid.study.estimates import ChainFound


def best_table(snapshot: Snapshot) -> pd.DataFrame:
    """One row a lump, as `lumps_frame` has them, by the best trial."""
    problem, survivors = snapshot.problem, snapshot.survivors
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
        # Of a lump that the measure does not see, a trial says nothing.
        factor, low, high = (np.where(np.isfinite(resolution), each, np.nan) for each in found)
    return _lump_rows(problem, problem.lumps.searched, factor, (unknown, low * nominal, high * nominal), determined)


def estimate_table(problem: Problem, found: ChainFound | None, is_result: bool) -> pd.DataFrame:
    """One row a lump, those of inertia included, as `lumps_frame` has them; NaN where there is no estimate. There are
    intervals where it `is_result`: it explains what was seen, or is approximate.
    """
    kinds = problem.estimated_kinds
    names = lump_names(problem.nominal.nlink, kinds)
    nominal = problem.nominal.lumps_of(kinds).vector_of(kinds)
    factor = deviation = low = high = np.full(len(names), np.nan)
    determined = np.zeros(len(names), dtype=np.bool_)
    if found is not None:
        factor = found.estimate.lumps.vector_of(kinds) / nominal
    if found is not None and is_result:
        deviation = found.lump_deviations
        low, high = factor * np.exp(-DEVIATIONS * deviation), factor * np.exp(DEVIATIONS * deviation)
        determined = deviation <= COARSEST
        if (extent := found.estimate.extent) is not None:
            low, high = np.exp(extent[0]), np.exp(extent[1])
            deviation, determined = np.full(len(names), np.nan), high - low <= 2.0 * COARSEST * factor
    intervals = factor * nominal * deviation, low * nominal, high * nominal
    return _lump_rows(problem, kinds, factor, intervals, determined)


def _lump_rows(
    problem: Problem,
    kinds: tuple[str, ...],
    factor: Array,
    intervals: tuple[Array, Array, Array],
    determined: NDArray[np.bool_],
) -> pd.DataFrame:
    """One row a lump beside the truth, as `lumps_frame` has them.

    Args:
        problem: of a study.
        kinds: of the lumps.
        factor: identified, of the nominal lumps (nlump); NaN where there is none.
        intervals: standard deviations and the lower and upper ends of the lumps (nlump); NaN where there are none.
        determined: which lumps (nlump) are.
    """
    names = lump_names(problem.nominal.nlink, kinds)
    nominal = problem.nominal.lumps_of(kinds).vector_of(kinds)
    truth = problem.open_plant().true_lumps()  # here, and only here, the truth meets the result
    true = np.full(len(names), np.nan) if truth is None else truth.vector_of(kinds, np.nan)
    units = [lump_unit(lump) for lump in names]
    return table_of((names, units), nominal, (factor, factor * nominal), intervals, (determined, true))


def table_of(
    names: tuple[Sequence[str], Sequence[str]],
    nominal: Array,
    found: tuple[Array, Array],
    intervals: tuple[Array, Array, Array],
    sure: tuple[NDArray[np.bool_], Array],
) -> pd.DataFrame:
    """What was found beside the truth, as `lumps_frame` has it, whatever is known of a plant.

    Args:
        names: of lumps or base parameters (nrow), and their units.
        nominal: values (nrow).
        found: what was identified as factors of these (nrow), and itself; NaN where it is not known.
        intervals: standard deviations, lower and upper ends (nrow); NaN where there are none.
        sure: which (nrow) are determined; and the true values, NaN where they are not known.
    """
    (name, unit), (factor, identified), (deviation, low, high), (determined, true) = names, found, intervals, sure
    columns = {
        "name": name,
        "unit": unit,
        "nominal": nominal,
        "factor": factor,
        "identified": identified,
        "sd": deviation,
        "low": low,
        "high": high,
        "true": true,
        "error": identified / np.where(true == 0.0, np.nan, true) - 1.0,
        "determined": determined,
    }
    return pd.DataFrame(columns)


def _resolution(problem: Problem) -> Array:
    """How well the trials can find each factor (nlump); inf where the pushes or the measure do not show the lump."""
    resolution = identifiability_by_measure(problem).resolution
    return np.where(problem.measure.determined(problem.lumps), resolution, np.inf)


def largest_error(lumps: pd.DataFrame) -> float | None:
    """The largest relative error of a determined lump in a table of `lumps`; None where one of them is not known, or no
    lump is determined.
    """
    errors = lumps["error"][lumps["determined"]].abs()
    return None if errors.empty or errors.isna().any() else float(errors.max())


def without_nan(row: dict[Any, Any]) -> dict[str, Any]:
    """A row of a frame as JSON has it: None for what is not known."""
    return {str(key): None if isinstance(value, float) and np.isnan(value) else value for key, value in row.items()}


def fault_table(problem: Problem, found: ChainFound | None, is_result: bool) -> pd.DataFrame:
    """One row a fault that was searched or taken up, see `[estimate] faults`: `name`, `unit`, `identified`, `sd`, `low`
    and `high` of the 95 % interval, `true`, `error`, which is the difference of the two, and whether it is
    `determined`. NaN as in `estimate_table`; no row where no fault was searched.
    """
    kinds = problem.spec.study.estimate.searched_faults
    if found is not None and found.estimate.faults is not None:
        kinds = found.estimate.faults.searched.kinds
    names, plant = fault_names(kinds, problem.nominal.nlink), problem.open_plant()
    nothing = np.full(len(names), np.nan)
    # Here, and only here, the truth meets the result.
    true = true_faults(plant, kinds) if isinstance(plant, MujocoPlant) else nothing
    value, deviation, determined = nothing, nothing, np.zeros(len(names), dtype=np.bool_)
    if found is not None and (faults := found.estimate.faults) is not None:
        value = faults.values
        if is_result:
            determined, deviation = faults.determined, found.widening * faults.deviations
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


def fault_rows(problem: Problem, found: ChainFound | None, is_result: bool) -> dict[str, Any]:
    """The same as `study show --json` has it, under `faults`; nothing where no fault is ever searched."""
    if not problem.spec.study.estimate.faults:
        return {}
    return {"faults": [without_nan(row) for row in fault_table(problem, found, is_result).to_dict("records")]}
