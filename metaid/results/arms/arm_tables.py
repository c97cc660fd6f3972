"""The trials and the base parameters of a study of an arm, as pandas frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from metaid.models import Array
from metaid.results.arms.arm_snapshot import ArmSnapshot
from metaid.results.lump_tables import DEVIATIONS, table_of
from metaid.results.snapshot import trial_columns
from metaid.study import COARSEST

ROUNDING = 1e-12  # of the largest base parameter of a unit


def arm_trials_table(snapshot: ArmSnapshot) -> pd.DataFrame:
    """One row a trial: `number`, `state`, `value` (NaN where it failed), `generation`, `steps`, and the base parameters
    of its law, in SI units.
    """
    trials, names = snapshot.trials, snapshot.problem.names
    values = np.array([trial.factors for trial in trials]).reshape(len(trials), len(names))
    heads = trial_columns(trials)
    return pd.DataFrame({**heads, **{name: values[:, i] for i, name in enumerate(names)}})


def base_table(snapshot: ArmSnapshot) -> pd.DataFrame:
    """One row a base parameter, with the columns of `lumps_frame` and its `expression`; NaN where nothing was found.

    One is determined that is known to a tenth of what it is, or of what it may have been wrong by beforehand.
    """
    problem, found = snapshot.problem, snapshot.estimate
    base, nominal = problem.belief.base, problem.belief.values
    identified = deviation = low = high = np.full(len(nominal), np.nan)
    determined = np.zeros(len(nominal), dtype=np.bool_)
    if found is not None and found.explains:
        values, deviation = found.estimate.values, found.estimate.value_deviations
        beforehand = np.sqrt(np.diag(problem.belief.covariance))
        determined = deviation <= COARSEST * np.maximum(np.abs(values), beforehand)
        reach = DEVIATIONS * deviation
        identified, low, high = (
            np.where(determined, each, np.nan) for each in (values, values - reach, values + reach)
        )
    truth = snapshot.truth
    true = np.full(len(nominal), np.nan) if truth is None else _settled(base.of(truth.parameters), base.units)
    believed = _settled(nominal, base.units)
    factor = identified / np.where(believed == 0.0, np.nan, believed)
    names, intervals = (base.names, base.units), (deviation, low, high)
    return table_of(names, believed, (factor, identified), intervals, (determined, true)).assign(
        expression=base.expressions
    )


def _settled(values: Array, units: Sequence[str]) -> Array:
    """Base parameters (nbase) without what rounding left of those that are 0: of the turn of a frame, say."""
    largest = {unit: float(np.abs(values[[other == unit for other in units]]).max()) for unit in set(units)}
    least = ROUNDING * np.array([largest[unit] for unit in units])
    return np.where(np.abs(values) <= least, 0.0, values)
