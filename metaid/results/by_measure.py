"""What the measure of a study tells of its best trial."""

from __future__ import annotations

from functools import singledispatch
from typing import Any

import numpy as np

from metaid.models import Array
from metaid.study import ArmProblem, Problem, identifiability_by_measure, lumps_at_bounds

NOMINAL_SENSITIVITY = 1.5  # by how much ranges by the nominal model's sensitivity are widened: it is not the plant's


@singledispatch
def resolution_at(problem: Any, best: Array) -> tuple[Array, float]:
    """How well the measure can tell each number of a candidate (n) from the `best` one (n) where that is as good as the
    measure's resolution, inf where it does not show it; and by how much ranges are to be wider than that.
    """
    raise TypeError(problem)


@resolution_at.register
def _of_lumps(problem: Problem, best: Array) -> tuple[Array, float]:
    """By the nominal model.  Eq. 14."""
    resolution = identifiability_by_measure(problem).resolution
    return np.where(problem.measure.determined(problem.lumps), resolution, np.inf), NOMINAL_SENSITIVITY


@resolution_at.register
def _of_base_parameters(problem: ArmProblem, best: Array) -> tuple[Array, float]:
    """By the mass matrix of the best arm.  Eq. 63."""
    root = problem.prior.root
    shown, axes = np.linalg.eigh(root.T @ problem.sensitivity(best) @ root)
    shown = np.maximum(shown, np.finfo(float).eps * shown[-1])
    return 2.0 * np.pi * problem.resolution * np.sqrt((((root @ axes) ** 2) / shown).sum(axis=1)), 1.0


@singledispatch
def at_bounds(problem: Any, best: Array, tried: Array) -> list[str]:
    """Which numbers of the `best` candidate (n) stand at a bound, of all that were `tried` (ntrial x n): none where
    bounds are too far away.
    """
    return []


@at_bounds.register
def _lumps(problem: Problem, best: Array, tried: Array) -> list[str]:
    return list(map(str, lumps_at_bounds(problem, best, tried)))
