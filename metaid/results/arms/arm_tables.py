"""The trials and the base parameters of a study of an arm, as pandas frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from metaid.models import DEVIATIONS, Array
from metaid.results.arms.arm_snapshot import ArmSnapshot
from metaid.results.lump_tables import table_of
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


def estimate_table(snapshot: ArmSnapshot, is_result: bool) -> pd.DataFrame:
    """One row a base parameter, with the columns of `lumps_frame` and its `expression`, by the estimate from all
    trials; NaN where there is none. There are intervals where it `is_result`: it explains what was seen, or is
    approximate.

    One is determined that is known to a tenth of what it is, or of what it may have been wrong by beforehand.
    """
    found, unknown = snapshot.estimate, np.full(len(snapshot.problem.names), np.nan)
    if found is None:
        return _base_rows(snapshot, unknown, unknown, unknown)
    values, deviation = found.estimate.values, found.deviations if is_result else unknown
    return _base_rows(snapshot, values, DEVIATIONS * deviation, deviation, deviation)


def best_table(snapshot: ArmSnapshot) -> pd.DataFrame:
    """The same by the best trial. Low and high are those of all base parameters with which the arm would coast as well
    as can be told, by the mass matrix of the best one (Eq. 63); there are no standard deviations.
    """
    problem, best, unknown = snapshot.problem, snapshot.best, np.full(len(snapshot.problem.names), np.nan)
    if best is None:
        return _base_rows(snapshot, unknown, unknown, unknown)
    value = 2.0 * np.pi * (best.outcome.value + problem.resolution)
    root = problem.prior.root
    shown, axes = np.linalg.eigh(root.T @ problem.sensitivity(best.factors) @ root)
    shown = np.maximum(shown, np.finfo(float).eps * shown[-1])
    reach = value * np.sqrt((((root @ axes) ** 2) / shown).sum(axis=1))
    return _base_rows(snapshot, best.factors, reach, reach)


def _base_rows(
    snapshot: ArmSnapshot, values: Array, reach: Array, coarse: Array, deviation: Array | None = None
) -> pd.DataFrame:
    """One row a base parameter.

    Args:
        snapshot: the study.
        values: identified (nbase); NaN where nothing was.
        reach: from there to either end of what it may be (nbase).
        coarse: what must be a tenth of it, or of what was believed, for it to be determined (nbase).
        deviation: standard deviations (nbase), where they are known.
    """
    prior = snapshot.problem.prior
    nominal, beforehand = prior.values, np.sqrt(np.diag(prior.covariance))
    determined = coarse <= COARSEST * np.maximum(np.abs(values), beforehand)
    units, truth = prior.base.units, snapshot.truth
    unknown = np.full(len(nominal), np.nan)
    true = unknown if truth is None else _settled(prior.base.of(truth.parameters), units)
    believed = _settled(nominal, units)
    factor = values / np.where(believed == 0.0, np.nan, believed)
    spread = unknown if deviation is None else deviation
    table = table_of(
        (prior.base.names, units),
        believed,
        (factor, values),
        (spread, values - reach, values + reach),
        (determined, true),
    )
    return table.assign(expression=prior.base.expressions)


def _settled(values: Array, units: Sequence[str]) -> Array:
    """Base parameters (nbase) without what rounding left of those that are 0: of the turn of a frame, say."""
    largest = {unit: float(np.abs(values[[other == unit for other in units]]).max()) for unit in set(units)}
    least = ROUNDING * np.array([largest[unit] for unit in units])
    return np.where(np.abs(values) <= least, 0.0, values)
