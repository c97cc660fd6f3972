"""What the measure of a study tells of its best trial."""

from __future__ import annotations

import numpy as np

from metaid.models import Array
from metaid.search import at_bounds, bounds_in_force, widened
from metaid.study import Problem, identifiability_by_measure

NOMINAL_SENSITIVITY = 1.5  # by how much ranges by the nominal model's sensitivity are widened: it is not the plant's


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
