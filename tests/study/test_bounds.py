"""A search that its bounds hold back is noticed, and says what to set."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from metaid.search.bounds import at_bounds, bounds_in_force, widened
from metaid.study.bounds import lumps_at_bounds
from metaid.study.problem import Problem, load_study


def problem_of(**changes: Any) -> Problem:
    """The two-link study with some settings changed; it searches three lumps between 0.5 and 2."""
    return Problem(load_study("two-link-tpe", changes))


def test_lump_within_a_tenth_of_the_way_of_a_bound_is_at_it() -> None:
    """Bounds of 0.5 and 2 are reached at 0.65 and at 1.85, and beyond them."""
    factors = np.array([0.4, 0.64, 0.66, 1.84, 1.86, 2.5])
    at_low, at_high = at_bounds(factors, np.full(6, 0.5), np.full(6, 2.0))
    assert at_low.tolist() == [True, True, False, False, False, False]
    assert at_high.tolist() == [False, False, False, False, True, True]


def test_only_bounds_that_are_reached_are_widened() -> None:
    """To a quarter and to four times, and never beyond the largest factor that a study may name."""
    low, high = widened(
        np.full(3, 0.5), np.array([2.0, 2.0, 50.0]), np.array([True, False, False]), np.array([False, False, True])
    )
    assert low.tolist() == [0.125, 0.5, 0.5]
    assert high.tolist() == [2.0, 2.0, 100.0]


def test_trial_beyond_a_bound_says_that_it_was_widened() -> None:
    """The bounds in force follow from the trials alone."""
    low, high = np.full(2, 0.5), np.full(2, 2.0)
    assert bounds_in_force(low, high, np.empty((0, 2)))[1].tolist() == [2.0, 2.0]
    assert bounds_in_force(low, high, np.array([[1.0, 1.9], [0.9, 2.1]]))[1].tolist() == [2.0, 8.0]


@pytest.mark.parametrize(
    ("changes", "setting"),
    [({}, "search.high=8"), ({"search.high.gravity_2": 2.0}, "search.high.gravity_2=8")],
)
def test_lump_at_its_bound_is_named_with_what_to_set(changes: dict[str, Any], setting: str) -> None:
    """One number for all lumps is set anew for all, and a table by lump for this one."""
    found = np.array([1.0, 1.97, 1.2])
    (reached,) = lumps_at_bounds(problem_of(**changes), found, np.array([found]))
    assert (reached.name, reached.side, reached.bound, reached.setting) == ("gravity_2", "high", 2.0, setting)
    key, _, value = setting.partition("=")
    again = problem_of(**changes | {key: float(value)})
    assert again.high[1] == 8.0
    assert "gravity_2" in str(reached)
    assert setting in str(reached)


def test_widened_bound_is_the_one_that_is_named() -> None:
    """A lump is at the bound that the last trial was proposed with."""
    problem, tried = problem_of(), np.array([[1.0, 1.0, 1.0], [0.3, 1.0, 1.0], [0.2, 1.0, 1.0]])
    assert lumps_at_bounds(problem, np.array([0.4, 1.0, 1.0]), tried) == ()
    (reached,) = lumps_at_bounds(problem, tried[-1], tried)
    assert (reached.name, reached.side, reached.bound, reached.setting) == (
        "gravity_1",
        "low",
        0.125,
        "search.low=0.03125",
    )


def test_lump_that_the_measure_cannot_see_is_not_held_back() -> None:
    """Counts do not find Coriolis lumps, so where these end means nothing."""
    problem = problem_of(**{"episode.measure": "count"})
    found = np.array([0.5, 1.0, 2.0])
    assert [each.name for each in lumps_at_bounds(problem, found, np.array([found]))] == ["gravity_1"]
