"""DINOIP: on functions whose least value is known, and on the paper's own plants."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Finished, random_plant

from metaid.compiled import Objective
from metaid.episode import Episode, Outcome, tip_push
from metaid.models import Array
from metaid.paper import MOST_STEPS_UP, Dinoip, DinoipOptions
from metaid.results import read_snapshot, trials_frame
from metaid.results.lump_tables import best_table
from metaid.store import Store
from metaid.study import create_study, load_study, run_study


def search(
    start: float, evaluate: Callable[[Array], float], nlump: int = 2, coarse_to_fine: bool = False
) -> list[Array]:
    """All candidates in order; `evaluate` gives the frequency, infinite for a fall."""
    options = DinoipOptions(coarse_to_fine=coarse_to_fine)
    dinoip, tried = Dinoip(np.full(nlump, start), np.full(nlump, 0.5), options), []
    while not dinoip.finished():
        (candidate,) = dinoip.ask()
        tried.append(candidate)
        value = evaluate(candidate)
        dinoip.tell([Outcome(value, not np.isfinite(value), 1, ())])
        assert len(tried) < 1000
    return tried


def best(tried: list[Array], evaluate: Callable[[Array], float]) -> list[float]:
    """The last candidate of least value."""
    return min(reversed(tried), key=evaluate).tolist()


def bowl(candidate: Array) -> float:
    """Least at (0.9, 1.13), where it falls beyond either."""
    return np.inf if candidate[0] < 0.9 or candidate[1] < 1.13 else float(candidate.sum())


@pytest.mark.parametrize("coarse_to_fine", [False, True])
def test_it_ends_just_before_the_fall(coarse_to_fine: bool) -> None:
    """Each lump is within an increment of where it falls, on the grid of the start."""
    assert best(search(1.5, bowl, coarse_to_fine=coarse_to_fine), bowl) == [0.9, 1.13]


def test_coarse_to_fine_needs_fewer_trials() -> None:
    """Ten increments at once until none helps, then one by one."""
    assert len(search(1.5, bowl, coarse_to_fine=True)) < len(search(1.5, bowl)) / 2


def test_all_lumps_step_down_together_first() -> None:
    """As in the paper's Table II; and the first candidate is the start."""
    first = search(1.5, bowl)[:4]
    assert np.array(first) == pytest.approx(np.array([[1.5, 1.5], [1.49, 1.49], [1.48, 1.48], [1.47, 1.47]]))


def test_no_candidate_is_tried_twice() -> None:
    """A trial is an experiment; its outcome is remembered."""
    tried = [tuple(candidate) for candidate in search(1.5, bowl, coarse_to_fine=True)]
    assert len(set(tried)) == len(tried)


def test_passing_rise_is_stepped_over_and_a_lasting_one_taken_back() -> None:
    """A count that goes up by one on its way down does not end the search; one that stays up does."""
    bump = lambda candidate: float(candidate[0] + (1.0 if 1.2 < candidate[0] < 1.2 + 0.01 * MOST_STEPS_UP else 0.0))  # noqa: E731
    assert best(search(1.5, bump, nlump=1), bump) == [0.5]
    valley = lambda candidate: float(abs(candidate[0] - 1.23))  # noqa: E731
    tried = search(1.5, valley, nlump=1)
    assert best(tried, valley) == [1.23]
    assert min(tried) == pytest.approx(1.23 - 0.01 * (MOST_STEPS_UP + 1))


def test_step_that_leaves_the_frequency_as_it_is_is_kept() -> None:
    """Counted periods stay for many steps: it goes on among equals, and ends at the last one before the fall."""
    counted = lambda candidate: float(np.floor(4.0 * candidate).sum()) if np.isfinite(bowl(candidate)) else np.inf  # noqa: E731
    tried = search(1.5, counted)
    assert best(tried, counted) == [0.9, 1.13]
    assert not np.isfinite(counted(tried[-1]))


def test_lump_that_changes_nothing_goes_down_to_its_bound() -> None:
    """The frequency stays, so every step is kept, and none leaves the bounds."""
    tried = search(1.5, lambda candidate: float(candidate[0]), nlump=2)
    assert tried[-1].tolist() == [0.5, 0.5]
    assert min(candidate.min() for candidate in tried) == 0.5


def test_start_of_least_frequency_is_gone_back_to() -> None:
    """The start is a candidate like any other: a step that is worse than it is taken back."""
    upwards = lambda candidate: float(-candidate.sum())  # noqa: E731
    tried = search(1.5, upwards)
    assert best(tried, upwards) == [1.5, 1.5]
    assert len(tried) == 1 + 3 * (MOST_STEPS_UP + 1)  # both lumps, and each alone


def test_spread_is_the_step() -> None:
    """From the first candidate on: the coarse step, and then the fine one."""
    one = np.ones(1)
    dinoip, spreads = Dinoip(one, 0.5 * one, DinoipOptions(coarse_to_fine=True)), []
    while not dinoip.finished():
        spreads.append(dinoip.spread)
        dinoip.tell([Outcome(1.0, bool(factors[0] < 0.93), 1, ()) for factors in dinoip.ask()])
    assert spreads[0] == pytest.approx(0.1)
    assert list(dict.fromkeys(spreads)) == [pytest.approx(0.1), 0.01]


def test_start_that_falls_ends_it() -> None:
    """There is nothing to step back to: the values were not large."""
    assert len(search(1.5, lambda candidate: np.inf)) == 1


def frequency(objective: Objective) -> Callable[[Array], float]:
    """The measure of a candidate, infinite for a fall."""

    def value(factors: Array) -> float:
        outcome = objective.evaluate(factors)
        return np.inf if outcome.fell else outcome.value

    return value


@pytest.mark.parametrize("measure", ["count", "crossing"])
@pytest.mark.parametrize("nlump", [1, 3])
@pytest.mark.parametrize("seed", [1, 2])
def test_gravity_lumps_from_an_uneven_nominal_model(measure: str, nlump: int, seed: int) -> None:
    """Within an increment of the truth on any chain of one or two links, wherever between the steps it lies."""
    plant, wrong = random_plant(min(nlump, 2), seed), np.random.default_rng(seed).uniform(0.8, 1.25, nlump)
    objective = Objective(plant, plant.chain.lumps.scaled(wrong), Episode(tip_push(plant, 0.1), 20_000), measure)
    value = functools.cache(lambda factors: frequency(objective)(np.array(factors)))
    evaluate = lambda candidate: value(tuple(candidate))  # noqa: E731
    factors = np.array(best(search(1.5, evaluate, nlump, coarse_to_fine=True), evaluate))
    assert np.abs(factors - 1.0 / wrong)[:2].max() < 0.01


@pytest.mark.parametrize("changes", [(), ("episode.rule=complete",), ("search.coarse_to_fine=true",)])
def test_one_link_of_the_paper_is_identified(metaid: Callable[..., Finished], changes: tuple[str, ...]) -> None:
    """From a factor of 1.3 to within 0.01, by the count alone; the estimate from the same trials is exact."""
    shown = identified(metaid, "paper-one-link", changes)
    assert shown["best"]["max_error"] <= 0.01
    assert shown["max_error"] < 1e-6
    assert shown["trials"]["pruned"] >= 1


@pytest.mark.slow
@pytest.mark.parametrize("changes", [(), ("search.coarse_to_fine=true",)])
def test_two_links_of_the_paper_are_identified_but_for_the_coriolis_lump(
    metaid: Callable[..., Finished], changes: tuple[str, ...]
) -> None:
    """Both gravity lumps within 0.01 by the count alone, and no number of the Coriolis lump; but nothing tested it."""
    shown = identified(metaid, "paper-two-link", (*changes, "estimate.enabled=false"))
    assert shown["verdict"] == "not found"
    assert "count alone cannot tell friction from wrong lumps: [estimate] enabled is false" in shown["reasons"][-1]
    with closing(Store("metaid.db")) as store:
        lumps = best_table(read_snapshot(store, "paper-two-link")).set_index("name")
    assert lumps["error"][["gravity_1", "gravity_2"]].abs().max() <= 0.01
    assert lumps["determined"].to_dict() == {"gravity_1": True, "gravity_2": True, "coriolis_1_2": False}
    assert lumps.loc["coriolis_1_2", ["factor", "identified", "low", "high", "error"]].isna().all()


def identified(metaid: Callable[..., Finished], name: str, changes: tuple[str, ...]) -> dict[str, Any]:
    """`study show --json` after a run."""
    metaid("study", "create", name, *(f"--set={change}" for change in changes))
    metaid("study", "run", name, "--quiet")
    shown: dict[str, Any] = json.loads(metaid("study", "show", name, "--json").out)
    return shown


@pytest.mark.slow
def test_stopped_and_resumed_it_tries_the_same(tmp_path: Path) -> None:
    """Whole, or in three parts: one table of trials."""
    spec = load_study("paper-two-link", {"search.coarse_to_fine": True})
    store = Store(str(tmp_path / "metaid.db"), create=True)
    for name, totals in (("whole", [500]), ("parts", [3, 9, 500])):
        create_study(store, spec, name)
        for total in totals:
            run_study(store, name, total)
    whole, parts = (trials_frame(store, name) for name in ("whole", "parts"))
    store.close()
    assert whole.equals(parts)
    assert 10 < len(whole) < 500
