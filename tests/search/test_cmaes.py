"""CMA-ES in the study's coordinates: within the bounds, repeatable, and it says how widely it looks."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from metaid.episode import Outcome
from metaid.models import Array
from metaid.search import Cmaes, Coordinates, StepOptions, plain_coordinates

TRUTH = np.array([1.2, 0.9, 1.1])


def searching(coordinates: Coordinates, generations: int, options: StepOptions, seed: int = 1) -> tuple[Cmaes, Array]:
    """The searcher after so many generations on a bowl about the truth, and all candidates (ncandidate x nlump)."""
    searcher, tried = Cmaes(coordinates, seed, options), []
    for _ in range(generations):
        candidates = searcher.ask()
        tried.append(candidates)
        searcher.tell([Outcome(float(np.linalg.norm(c - TRUTH[: len(c)])), False, 1, ()) for c in candidates])
    return searcher, np.concatenate(tried)


def plain(low: float = 0.5, high: float = 2.0) -> Coordinates:
    """Three factors from a start of 1."""
    one = np.ones(3)
    return plain_coordinates(one, low * one, high * one)


def test_it_finds_the_least_value() -> None:
    """Of a bowl, to six digits."""
    _, tried = searching(plain(), 100, StepOptions())
    assert tried[-1] == pytest.approx(TRUTH, abs=1e-6)


def test_same_seed_proposes_the_same_and_another_does_not() -> None:
    """All that it draws at random comes from the seed."""
    one, same, other = (searching(plain(), 3, StepOptions(), seed)[1] for seed in (1, 1, 2))
    assert (one == same).all()
    assert (one != other).any()


def test_generation_is_as_large_as_the_study_says() -> None:
    """Whatever the sampler's own number is."""
    assert len(searching(plain(), 1, StepOptions(generation=23))[1]) == 23


def test_candidates_are_drawn_within_the_bounds_and_not_moved_to_them() -> None:
    """Where a tenth of all draws are inside, none of a hundred candidates lies on a bound."""
    _, tried = searching(plain(0.9, 1.1), 1, StepOptions(sigma=0.15, generation=100))
    assert ((tried > 0.9) & (tried < 1.1)).all()


def test_candidate_that_cannot_be_drawn_within_the_bounds_is_moved_to_them() -> None:
    """Where next to no draw is inside, the candidate is the nearest of those that are."""
    coordinates = plain(0.999999, 1.000001)
    searcher, tried = searching(coordinates, 2, StepOptions(sigma=10.0))
    assert ((tried == 0.999999) | (tried == 1.000001)).mean() > 0.9
    assert not searcher.finished()


def test_spread_is_that_of_the_candidates_and_shrinks() -> None:
    """Before the first generation it is the first step; then how far candidates are from the mean."""
    searcher = Cmaes(plain(), 1, StepOptions(sigma=0.05, generation=400))
    assert searcher.spread == 0.05
    candidates = searcher.ask()
    assert searcher.spread == pytest.approx(0.05, rel=0.1)
    assert searcher.spread == pytest.approx(float(np.sqrt(np.mean((candidates - 1.0) ** 2))))
    searcher, _ = searching(plain(), 40, StepOptions())
    assert searcher.spread is not None
    assert searcher.spread < 1e-3


def test_candidates_do_not_hang_on_which_eigenvectors_are_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    """With more lumps than candidates in a generation another BLAS finds others, and candidates are the same."""
    one = np.ones(15)
    coordinates = plain_coordinates(one, 0.5 * one, 2.0 * one)
    truth = np.random.default_rng(0).uniform(0.8, 1.2, 15)

    def tried() -> Array:
        searcher, seen = Cmaes(coordinates, 1, StepOptions()), []
        for _ in range(30):
            candidates = searcher.ask()
            seen.append(candidates)
            searcher.tell([Outcome(float(np.linalg.norm(c - truth)), False, 1, ()) for c in candidates])
        return np.concatenate(seen)

    before, eigh = tried(), np.linalg.eigh

    def other_eigh(matrix: Array) -> tuple[Array, Array]:
        values, vectors = eigh(matrix)
        return values, vectors * np.where(np.arange(len(values)) % 2, 1.0, -1.0)

    monkeypatch.setattr(np.linalg, "eigh", other_eigh)
    assert np.allclose(tried(), before, rtol=0.0, atol=1e-9)


@pytest.mark.slow
def test_search_by_cma_es_loads_cmaes_without_scipy_stats_and_leaves_that_to_others() -> None:
    """scipy.stats would be a good part of a short run; afterwards whoever wants it has it, and all of cmaes works."""
    code = (
        "import sys, numpy as np; from metaid.search.cmaes import load_cmaes; load_cmaes(); "
        "print('scipy.stats' in sys.modules); "
        "import cmaes, scipy.stats; print(round(scipy.stats.norm.cdf(0.0), 3)); "
        "print(cmaes.CMAwM(mean=np.zeros(2), sigma=1.0, bounds=np.array([[-5, 5], [-5, 5]]), "
        "steps=np.array([1.0, 0.0])).ask()[0].shape)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n") == ["False", "0.5", "(2,)", ""]
