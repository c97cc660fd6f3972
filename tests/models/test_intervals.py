"""Intervals hold what they say, one value or several at once."""

from __future__ import annotations

import numpy as np
import pytest

from metaid.models import DEVIATIONS, deviations_at_once, half_width

DRAWS = 40_000
CHANCE = 0.004  # four standard deviations of a share of so many draws


def test_one_interval_reaches_as_far_as_each() -> None:
    """At once is nothing else for a single value."""
    assert deviations_at_once(1) == pytest.approx(DEVIATIONS, abs=1e-4)


@pytest.mark.parametrize("count", [2, 9, 40])
@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.99])
def test_all_values_are_inside_at_once(count: int, correlation: float) -> None:
    """With 95 % where they are independent, with more where they are not; by intervals of one each hardly ever."""
    random = np.random.default_rng(count)
    shared, own = random.standard_normal((DRAWS, 1)), random.standard_normal((DRAWS, count))
    farthest = np.abs(np.sqrt(correlation) * shared + np.sqrt(1.0 - correlation) * own).max(axis=1)
    inside = np.mean(farthest <= deviations_at_once(count))
    assert inside >= 0.95 - CHANCE
    if correlation == 0.0:
        assert inside <= 0.95 + CHANCE
        assert np.mean(farthest <= DEVIATIONS) < 0.92


def test_half_width_is_that_of_the_least_known_value() -> None:
    """Of a value that is e^z times another, to either side in the mean.  Eq. 32."""
    reach = deviations_at_once(3) * 0.2
    expected = 0.5 * (np.exp(reach) - np.exp(-reach))
    assert half_width(np.array([0.1, 0.2, 0.01])) == pytest.approx(expected)
