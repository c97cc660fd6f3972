"""What the measure of a study tells of its best trial."""

from __future__ import annotations

import numpy as np

from metaid.models import Array
from metaid.study import Problem, identifiability_by_measure, lumps_at_bounds

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


def at_bounds(problem: Problem, best: Array, tried: Array) -> list[str]:
    """Which numbers of the `best` candidate (n) stand at a bound, of all that were `tried` (ntrial x n): none of an
    arm, whose bounds are too far away.
    """
    return [] if problem.spec.is_arm else list(map(str, lumps_at_bounds(problem, best, tried)))
