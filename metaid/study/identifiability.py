"""What a study can determine and what it cannot, from its nominal model alone, before any trial.

The nominal model is taken for the truth. The question is which other factors the study's measure cannot tell from it.
For `spectral` and `smoothed` the sensitivity H answers for all lumps together (Eqs. 11 and 14). `count` and `crossing`
have no such form. For them one factor at a time is moved away from 1, until the measure notices or a bound is met.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models import Array
from metaid.study.problem import Problem

COARSEST = 0.1  # a lump that is not known better than to a tenth is not determined: its nominal value is as good
NEGLIGIBLE = 0.02  # weight of a lump in a combination, of 1
HALVINGS = 11  # of the interval in which a factor stops being noticed


@dataclass(frozen=True)
class Identifiability:
    """By lump `names`: the `resolution` (nlump) with which its factor can be found, as a fraction; inf if not at all.

    `combinations`: changes of the factors, by lump name, that the measure does not notice at all or hardly; largest
    first.
    """

    names: tuple[str, ...]
    resolution: Array
    combinations: tuple[dict[str, float], ...] = ()

    @property
    def determined(self) -> list[bool]:
        """Whether each lump can be found to better than a tenth."""
        return [bool(value <= COARSEST) for value in self.resolution]

    @property
    def undetermined_names(self) -> list[str]:
        """The lumps that cannot."""
        return [name for name, found in zip(self.names, self.determined, strict=True) if not found]


def identifiability(problem: Problem) -> Identifiability:
    """What the measure and the pushes of a study can determine, if its nominal model were the truth."""
    if problem.measure.sees_coriolis:
        return _from_sensitivity(problem)
    return Identifiability(tuple(problem.names), _one_by_one(problem))


def _from_sensitivity(problem: Problem) -> Identifiability:
    """Half the width of the ellipsoid δᵀ H δ = (2π resolution)² along each lump.  Eq. 14."""
    h = problem.sensitivity()
    values, vectors = np.linalg.eigh(h)
    seen = values > len(values) * np.finfo(float).eps * values[-1]
    widths = np.full(len(values), np.inf)
    widths[seen] = 2.0 * np.pi * problem.resolution / np.sqrt(values[seen])
    weights = np.where(np.abs(vectors) > NEGLIGIBLE, vectors, 0.0)
    along = np.multiply(np.abs(weights), widths, out=np.zeros(h.shape), where=weights != 0.0)
    combinations = tuple(
        {problem.names[lump]: float(weight) for lump, weight in enumerate(weights[:, i]) if weight != 0.0}
        for i in np.flatnonzero(widths > COARSEST)
    )
    return Identifiability(tuple(problem.names), np.sqrt((along**2).sum(axis=1)), combinations)


def _one_by_one(problem: Problem) -> Array:
    """The largest change (nlump) of each factor alone, within its bounds, that the measure does not tell from none; inf
    where it does not notice a bound.
    """
    from metaid.compiled import Objective  # loads MuJoCo and numba, which other measures do without

    rule = problem.spec.study.episode.rule
    nominal = problem.nominal_plant()
    objective = Objective(nominal, problem.lumps, problem.episode, problem.measure.name, rule=rule)
    exact = np.ones(len(problem.names))
    unnoticed = objective.evaluate(exact).value + problem.resolution

    def noticed(lump: int, factor: float) -> bool:
        factors = exact.copy()
        factors[lump] = factor
        outcome = objective.evaluate(factors)
        return outcome.fell or outcome.value > unnoticed

    def farthest(lump: int, bound: float) -> float:
        """The distance from 1 towards the bound up to which nothing is noticed, inf if that is the bound."""
        if not noticed(lump, bound):
            return np.inf
        near, far = 0.0, bound - 1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (near + far)
            near, far = (near, middle) if noticed(lump, 1.0 + middle) else (middle, far)
        return abs(far)

    # Where a bound is 1, or 1 is out of bounds, there is no room on that side.
    below = [farthest(lump, low) if low < 1.0 else 0.0 for lump, low in enumerate(problem.low)]
    above = [farthest(lump, high) if high > 1.0 else 0.0 for lump, high in enumerate(problem.high)]
    return np.maximum(below, above)
