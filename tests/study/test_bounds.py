"""A search that its bounds hold back is noticed, and says what to set."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chain_studies import chain_study, random_chain
from conftest import best_error

from metaid import results
from metaid.results.best import bounds_reached
from metaid.search import at_bounds, bounds_in_force, widened
from metaid.store import Store
from metaid.study import Problem, create_study, load_study, run_study

pytestmark = pytest.mark.slow


def problem_of(**changes: Any) -> Problem:
    """The two-link study with some settings changed; it searches three lumps between 0.5 and 2."""
    return Problem(load_study("two-link-tpe", changes))


def test_lump_that_is_very_near_a_bound_is_at_it() -> None:
    """Within 3 % of the way between them, so bounds of 0.5 and 2 are reached at 0.545 and at 1.955, and beyond."""
    factors = np.array([0.4, 0.54, 0.55, 1.95, 1.96, 2.5])
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
    (reached,) = bounds_reached(problem_of(**changes), found, np.array([found]))
    assert reached == (f"gravity_2 is at its bound: its factor is 1.97, and search.high is 2 (try --set {setting})")
    key, _, value = setting.partition("=")
    again = problem_of(**changes | {key: float(value)})
    assert again.high[1] == 8.0


def test_widened_bound_is_the_one_that_is_named() -> None:
    """A lump is at the bound that the last trial was proposed with."""
    problem, tried = problem_of(), np.array([[1.0, 1.0, 1.0], [0.3, 1.0, 1.0], [0.15, 1.0, 1.0]])
    assert bounds_reached(problem, np.array([0.4, 1.0, 1.0]), tried) == []
    (reached,) = bounds_reached(problem, tried[-1], tried)
    assert reached == (
        "gravity_1 is at its bound: its factor is 0.15, and search.low is 0.125 (try --set search.low=0.03125)"
    )


def test_lump_that_the_measure_cannot_see_is_not_held_back() -> None:
    """Counts do not find Coriolis lumps, so where these end means nothing."""
    problem = problem_of(**{"episode.measure": "count"})
    found = np.array([0.5, 1.0, 2.0])
    assert [each.split()[0] for each in bounds_reached(problem, found, np.array([found]))] == ["gravity_1"]


ALONE = {"estimate.enabled": False}  # the search is judged by its best trial
# The six lumps of the three-link-coast study are beyond, by up to 60 %.
TIGHT = {"search.low": 0.9, "search.high": 1.1, **ALONE}


def run_tight(store: Store, name: str, *stops: int, **changes: Any) -> None:
    """Runs the three-link-coast study in bounds that exclude the truth, up to each of the `stops`."""
    spec = load_study("three-link-coast", TIGHT | changes)
    create_study(store, spec, name)
    for trials in stops or (spec.study.trials,):
        run_study(store, name, trials)


def held_back(store: Store, name: str) -> list[str]:
    """The lumps that a study of lumps ended with at a bound."""
    snapshot = results.read_snapshot(store, name)
    best = snapshot.best
    assert best is not None
    tried = np.array([trial.factors for trial in snapshot.trials])
    return [reached.split()[0] for reached in bounds_reached(snapshot.problem, best.factors, tried)]


def test_search_that_a_bound_holds_back_moves_it_away(tmp_path: Path) -> None:
    """Once, after a quarter of its trials; without leave it ends at its bounds, and they are named."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    run_tight(store, "widened")
    assert best_error(store, "widened") < 0.05
    run_tight(store, "held", 300, **{"search.widen": False})
    assert best_error(store, "held") > 0.1
    assert results.summary(store, "held")["verdict"] == "unfinished"
    assert held_back(store, "held")
    factors = results.trials_frame(store, "held").filter(regex="^(gravity|coriolis)_")
    assert ((factors >= 0.9) & (factors <= 1.1)).all(axis=None)


def test_tip_that_is_far_heavier_than_believed_is_found_by_the_best_trial(tmp_path: Path) -> None:
    """Four links, gravity_4 2.5 times the nominal and the bounds that nobody has set."""
    true, nominal = random_chain(4, 1)
    nominal = *nominal[:3], true[3].model_copy(update={"mass": true[3].mass / 2.5})
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, chain_study((true, nominal), sampler="cmaes", trials=1200, seed=1, estimate={"enabled": False}))
    run_study(store, "chain")
    lumps = results.lumps_frame(store, "chain").set_index("name")
    assert lumps["true"]["gravity_4"] > 2.2 * lumps["nominal"]["gravity_4"]
    assert best_error(store, "chain") < 0.05


def test_widened_study_has_the_same_trials_however_often_it_is_stopped(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Before the bounds are moved, in the generation in which they are, and after; that they are is said."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    run_tight(store, "whole", 260)
    assert "bounds held the search back and are moved: search.low of gravity_" in caplog.messages[0]
    run_tight(store, "stopped", 149, 151, 158, 200, 260)
    assert results.trials_frame(store, "whole").equals(results.trials_frame(store, "stopped"))
    assert (results.trials_frame(store, "whole").filter(regex="^gravity_") < 0.9).any(axis=None)


def test_bounds_stay_where_the_best_trial_is_as_good_as_exact(tmp_path: Path) -> None:
    """A lump that is near a bound by right moves nothing."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, load_study("three-link-coast", {"search.high": 1.15, **ALONE}), "study")
    problem = run_study(store, "study").problem
    assert best_error(store, "study") < 1e-3
    assert problem.high.max() == 1.15
