"""Which trial a study's result is taken from, which trials are as good as that one, and what the measure tells of it.

Everything that shows a result asks here: `study show`, its JSON, frames, figures, the report, the dashboard's note,
`validate` and films. So they cannot disagree where several trials have the same least value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.models import COARSEST, Array
from metaid.search import at_bounds, bounds_in_force, widened
from metaid.store import Trial
from metaid.study import Known, Parameters, Problem, identifiability_by_measure

NOMINAL_SENSITIVITY = 1.5  # by how much ranges by the nominal model's sensitivity are widened: it is not the plant's


def best_index(values: Array) -> int:
    """The position of the best of survivors with these `values` (ntrial), in the order in which they were evaluated.

    It is the last of those with the least value. A sampler that goes on among equal values has a reason to: DINOIP
    steps down until the next step falls, so its last survivor is the nearest to the truth.
    """
    return len(values) - 1 - int(values[::-1].argmin())


def best_rows(survivors: pd.DataFrame, count: int) -> pd.DataFrame:
    """The `count` best rows of a frame of `survivors`, the best first; of equals the later ones are kept."""
    ordered = survivors.iloc[::-1].sort_values("value", kind="stable")
    return ordered.iloc[:count]


def evenly(rows: pd.DataFrame, most: int) -> pd.DataFrame:
    """At most so many of the `rows`, evenly spaced."""
    return rows.iloc[:: max(-(-len(rows) // most), 1)]


def best_and_even(trials: pd.DataFrame, most: int, best: int) -> pd.DataFrame:
    """At most so many of some `trials`: the `best` survivors among them, and others evenly spaced."""
    kept = best_rows(trials[trials["state"] == "COMPLETE"], best)
    return pd.concat([kept, evenly(trials.drop(kept.index), most - len(kept))])


def identified_factors(problem: Problem, factors: Array, values: Array) -> Array:
    """The candidate (n) that follows from a study's survivors, which are `factors` (ntrial x n) with `values` of the
    measure (ntrial), in the order in which they were evaluated.

    It is the best trial's; of a noisy measure, whose best trial is only the luckiest, it is the mean of the trials that
    cannot be told from it.
    """
    best = best_index(values)
    if problem.measure.is_noisy:
        mean: Array = factors[values <= problem.as_good_as(float(values[best]))].mean(axis=0)
        return mean
    identified: Array = factors[best]
    return identified


def known_by_best(problem: Problem, survivors: Sequence[Trial]) -> Known:
    """What the best of these `survivors` says of what was sought, in SI units; there are no standard deviations.

    Low and high are the range of the trials that the measure cannot tell from the best, which the paper calls the range
    of possible values. They are a sample, and often a small one. Where the measure sees all, the range is at least as
    wide as the ellipsoid of the candidates whose value is as small as theirs, by the sensitivity (Eqs. 17 and 64).
    """
    wanted, scale = problem.robot.sought, problem.robot.sought.scale
    nothing = np.full(len(scale), np.nan)
    if not survivors:
        resolution, _ = resolution_at(problem, wanted.nominal / scale)
        return replace(Known.alone(nothing), determined=_is_shown(wanted, resolution))
    factors = np.array([trial.factors for trial in survivors])
    values = np.array([trial.outcome.value for trial in survivors])
    best = identified_factors(problem, factors, values)
    limit, (resolution, margin) = problem.as_good_as(float(values.min())), resolution_at(problem, best)
    equal = factors[values <= limit]
    low, high = equal.min(axis=0), equal.max(axis=0)
    if problem.measure.sees_coriolis:
        reach = margin * resolution * limit / problem.resolution
        low, high = np.minimum(low, best - reach), np.maximum(high, best + reach)
    known = Known(scale * best, nothing, scale * low, scale * high, _is_shown(wanted, resolution))
    narrow = known.high - known.low <= 2.0 * COARSEST * wanted.sizes(known.values)
    # Of a lump that the measure does not see, a trial says nothing.
    return replace(known.only(np.isfinite(resolution)), determined=known.determined & narrow)


def _is_shown(wanted: Parameters, resolution: Array) -> NDArray[np.bool_]:
    """Which of what is `wanted` (n) the measure tells to a tenth, by the `resolution` of a candidate's numbers (n)."""
    return resolution <= COARSEST * wanted.sizes(wanted.nominal) / wanted.scale


def resolution_at(problem: Problem, best: Array) -> tuple[Array, float]:
    """How well the measure can tell each number of a candidate (n) from the `best` one (n) where that is as good as the
    measure's resolution, inf where it does not show it; and by how much ranges are to be wider than that. Lumps by the
    nominal model (Eq. 17), base parameters by the mass matrix of the best arm (Eq. 64).
    """
    if not problem.spec.is_arm:
        resolution = identifiability_by_measure(problem).resolution
        return np.where(problem.chain.seen, resolution, np.inf), NOMINAL_SENSITIVITY
    root = problem.arm.prior.root
    shown, axes = np.linalg.eigh(root.T @ problem.arm.sensitivity(best) @ root)
    shown = np.maximum(shown, np.finfo(float).eps * shown[-1])
    return 2.0 * np.pi * problem.resolution * np.sqrt((((root @ axes) ** 2) / shown).sum(axis=1)), 1.0


def bounds_reached(problem: Problem, best: Array, tried: Array) -> list[str]:
    """Which lumps of the `best` candidate (n) are at a bound, or beyond it, and what to set, a sentence each; none of
    an arm, whose bounds are too far away.

    A lump may be there by right. But where the value of the best trial is also far above the measure's resolution, the
    search was held back. Lumps that the measure cannot see are left out. The factors (ntrial x n) that were `tried` say
    whether a bound has been widened.
    """
    if problem.spec.is_arm:
        return []
    low, high = bounds_in_force(problem.low, problem.high, tried)
    seen = problem.is_matching | problem.robot.seen
    at_low, at_high = (at & seen for at in at_bounds(best, low, high))
    lower, higher = widened(low, high, at_low, at_high)
    said = []
    for lump in np.flatnonzero(at_low | at_high).tolist():
        side, bound, wider = ("low", low, lower) if at_low[lump] else ("high", high, higher)
        has_table = isinstance(getattr(problem.spec.study.search, side), dict)
        name = problem.names[lump]
        key = f"search.{side}.{name}" if has_table else f"search.{side}"  # one number is that of all lumps
        said.append(
            f"{name} is at its bound: its factor is {best[lump]:.3g}, and search.{side} is {bound[lump]:g} "
            f"(try --set {key}={wider[lump]:g})"
        )
    return said
