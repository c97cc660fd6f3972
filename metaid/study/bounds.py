"""The lumps that a study ended with at a bound, and what to set in its place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from metaid.models import Array
from metaid.search import at_bounds, bounds_in_force, widened
from metaid.study.problem import Problem


@dataclass(frozen=True)
class LumpAtBound:
    """A lump by `name` whose `factor` is at a bound, or beyond it.

    Attributes:
        name: of the lump.
        side: which bound it is, the setting "low" or "high" of `[search]`.
        bound: the factor at which it stood when the last trial was proposed.
        factor: of the lump, as it was found.
        setting: what to set, as `study create --set` takes it.
    """

    name: str
    side: Literal["low", "high"]
    bound: float
    factor: float
    setting: str

    def __str__(self) -> str:
        return (
            f"{self.name} is at its bound: its factor is {self.factor:.3g}, and search.{self.side} is {self.bound:g} "
            f"(try --set {self.setting})"
        )


def lumps_at_bounds(problem: Problem, found: Array, tried: Array) -> tuple[LumpAtBound, ...]:
    """The lumps of a study that are at a bound, or beyond one, in what was found.

    A lump may be there by right. But where the value of the best trial is also far above the measure's resolution, the
    search was held back. Lumps that the measure cannot see are left out.

    Args:
        problem: of the study.
        found: factors (nlump) of the best trial, or of the estimate.
        tried: the factors (ntrial x nlump) of all trials; they say whether a bound has been widened.
    """
    low, high = bounds_in_force(problem.low, problem.high, tried)
    seen = problem.is_matching | problem.robot.seen
    at_low, at_high = (at & seen for at in at_bounds(found, low, high))
    lower, higher = widened(low, high, at_low, at_high)
    reached = []
    for lump in np.flatnonzero(at_low | at_high).tolist():
        name, factor = problem.names[lump], float(found[lump])
        if at_low[lump]:
            setting = _setting(problem, "low", name, lower[lump])
            reached.append(LumpAtBound(name, "low", float(low[lump]), factor, setting))
        else:
            setting = _setting(problem, "high", name, higher[lump])
            reached.append(LumpAtBound(name, "high", float(high[lump]), factor, setting))
    return tuple(reached)


def _setting(problem: Problem, side: Literal["low", "high"], name: str, bound: float) -> str:
    """A bound of one lump where the study file has a table of them, and else that of all."""
    has_table = isinstance(getattr(problem.spec.study.search, side), dict)
    return f"search.{side}{f'.{name}' if has_table else ''}={bound:g}"
