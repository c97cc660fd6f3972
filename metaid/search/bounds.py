"""Bounds that a search ends at, and where they are moved to.

A search that is held back by a bound presses against it. What it then has is not what the motion says, but what it was
allowed to try.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array

NEAR = 0.03  # of the way between the bounds: candidates are drawn this side of a bound
WIDENING = 4.0  # a bound of 2 becomes 8, one of 0.5 becomes 0.125
LEAST_FACTOR, LARGEST_FACTOR = 1e-6, 100.0  # that a widened bound may be: no factor beyond is a chain's


def at_bounds(factors: Array, low: Array, high: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether each of the `factors` (nlump) is at its bound `low` or beyond, and whether it is at `high`; (nlump) each.

    At a bound means within NEAR of the way between the two.
    """
    room = NEAR * (high - low)
    return factors <= low + room, factors >= high - room


def widened(low: Array, high: Array, at_low: NDArray[np.bool_], at_high: NDArray[np.bool_]) -> tuple[Array, Array]:
    """The bounds (nlump) once those are moved away that a search is at.

    Args:
        low: bounds of the factors (nlump).
        high: bounds of the factors (nlump).
        at_low: which lumps (nlump) are at the low one.
        at_high: which lumps (nlump) are at the high one.
    """
    lower = np.where(at_low, np.maximum(low / WIDENING, np.minimum(low, LEAST_FACTOR)), low)
    higher = np.where(at_high, np.minimum(high * WIDENING, np.maximum(high, LARGEST_FACTOR)), high)
    return lower, higher


def bounds_in_force(low: Array, high: Array, tried: Array) -> tuple[Array, Array]:
    """The bounds (nlump) of the last of all factors that were `tried` (ntrial x nlump).

    A search never leaves its bounds. So a factor beyond the bound that a study began with says that this was widened.

    Args:
        low: bounds that the study began with (nlump).
        high: bounds that the study began with (nlump).
        tried: the factors of all its trials (ntrial x nlump).
    """
    if not len(tried):
        return low, high
    return widened(low, high, tried.min(axis=0) < low, tried.max(axis=0) > high)
