"""Optuna's samplers in a study's coordinates: where they look, and that it leads to the truth."""

from __future__ import annotations

import pickle

import numpy as np
import optuna
import pytest
from optuna.samplers import BaseSampler, CmaEsSampler, RandomSampler, TPESampler

from metaid.episode import Outcome
from metaid.search import Coordinates, MetricSampler, SamplerOptions, make_searcher, tpe_for_metric
from metaid.search.optuna_samplers.metric import REACH, UNIFORM_EVERY

LUMPS = 4
NAMES = [f"factor_{i}" for i in range(LUMPS)]
CURVATURE = 0.04  # Hz²
TRUTH = np.array([1.3, 0.8, 1.15, 0.9])


def metric(curvature: float | None = CURVATURE) -> Coordinates:
    """Coordinates that are not those of the factors."""
    spread = np.array([[1.0, 0.3, 0.0, 0.1], [0.3, 0.8, 0.1, 0.0], [0.0, 0.1, 0.5, 0.2], [0.1, 0.0, 0.2, 0.6]])
    return Coordinates(np.ones(LUMPS), spread, np.full(LUMPS, 0.5), np.full(LUMPS, 2.0), curvature)


def distance(factors: np.ndarray) -> float:
    """From the truth, in z."""
    return float(np.linalg.norm(metric().z(factors) - metric().z(TRUTH)))


def value(factors: np.ndarray) -> float:
    """A measure that is as round as the coordinates say, in Hz."""
    return float(np.sqrt(CURVATURE)) * distance(factors)


def searched(name: str, trials: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """The generations that a sampler of a study proposes for that measure, and all factors in their order."""
    searcher, generations = make_searcher(name, metric(), 1, SamplerOptions()), []
    while sum(map(len, generations)) < trials and not searcher.finished():
        generations.append(searcher.ask())
        searcher.tell([Outcome(value(factors), False, 100, ()) for factors in generations[-1]])
    return generations, list(np.concatenate(generations))


def test_tpe_looks_in_a_cube_about_the_best_trial_that_shrinks_with_it() -> None:
    """After each generation no coordinate of z is farther from the best trial's than 1.2 d/√n, d its distance."""
    generations, _ = searched("tpe", 120)
    assert len(generations[0]) == 1
    assert (generations[0] == 1.0).all()
    tried = generations[0]
    for generation in generations[1:]:
        best = min(tried, key=value)
        reach = REACH * distance(best) / np.sqrt(LUMPS)
        steps = [np.abs(metric().z(factors) - metric().z(best)).max() for factors in generation]
        assert max(steps) <= reach * (1 + 1e-9)
        tried = np.concatenate([tried, generation])
    assert distance(min(tried, key=value)) < 0.01


@pytest.mark.parametrize("name", ["tpe", "optuna-cmaes"])
def test_search_ends_where_the_measure_says_that_it_is_at_the_truth(name: str) -> None:
    """And `spread` is the distance that is left."""
    searcher = make_searcher(name, metric(), 1, SamplerOptions())
    searcher.ask()
    searcher.tell([Outcome(0.02, False, 100, ())])
    assert searcher.spread == pytest.approx(0.1)
    assert not searcher.finished()
    candidates = searcher.ask()
    searcher.tell([Outcome(1e-9, False, 100, ()) for _ in candidates])
    assert searcher.finished()


def test_cmaes_of_optuna_begins_at_the_start_and_comes_to_the_truth() -> None:
    """Today's default would begin in the middle of the bounds, wherever the start is."""
    generations, tried = searched("optuna-cmaes", 200)
    assert (generations[0] == 1.0).all()
    early = metric().z(np.mean(generations[1], axis=0))
    assert np.linalg.norm(early) < distance(np.ones(LUMPS))
    assert distance(min(tried, key=value)) < 0.02


@pytest.mark.parametrize("name", ["tpe", "optuna-cmaes"])
def test_search_goes_on_among_falls_alone(name: str) -> None:
    """Nothing says how far the truth is then; candidates keep within the bounds."""
    searcher = make_searcher(name, metric(), 1, SamplerOptions())
    for _ in range(6):
        candidates = searcher.ask()
        assert ((candidates >= 0.5) & (candidates <= 2.0)).all()
        searcher.tell([Outcome(500.0, True, 3, ()) for _ in candidates])
    assert searcher.spread is None or searcher.spread > 1.0


SAMPLERS = {
    "tpe": lambda seed: TPESampler(seed=seed),
    "cmaes": lambda seed: CmaEsSampler(seed=seed, popsize=6),
    "random": lambda seed: RandomSampler(seed=seed),
}


@pytest.mark.parametrize("name", SAMPLERS)
def test_any_sampler_of_optunas_works_in_the_metric(name: str) -> None:
    """In a plain Optuna study whose trials have factors; random search in the moving cube, too."""
    study = optuna.create_study(sampler=MetricSampler(NAMES, metric(), SAMPLERS[name](1)))
    study.optimize(lambda trial: value(np.array([trial.suggest_float(each, 0.5, 2.0) for each in NAMES])), 200)
    assert distance(np.array([study.best_params[each] for each in NAMES])) < 0.02
    assert study.trials[0].params == dict.fromkeys(NAMES, 1.0)


@pytest.mark.parametrize("sampler", [tpe_for_metric(1), CmaEsSampler(seed=1)], ids=["tpe", "cmaes"])
def test_sampler_goes_on_in_another_process_where_it_was(sampler: BaseSampler) -> None:
    """What it has learned is in the study; a copy by pickle proposes as the first one would."""
    storage = optuna.storages.InMemoryStorage()
    optuna.create_study(study_name="study", storage=storage)
    copy = MetricSampler(NAMES, metric(), sampler)
    for _ in range(3):
        copy = pickle.loads(pickle.dumps(copy))
        study = optuna.load_study(study_name="study", storage=storage, sampler=copy)
        study.optimize(lambda trial: value(np.array([trial.suggest_float(each, 0.5, 2.0) for each in NAMES])), 50)
    assert study.best_value < 0.1 * study.trials[0].value


def test_one_of_four_trials_is_drawn_uniformly() -> None:
    """Kernels of TPE about a few good trials cannot keep a search where nothing improves."""

    class Stuck(RandomSampler):
        """Proposes the same again and again."""

        def sample_relative(self, study, trial, search_space):  # type: ignore[no-untyped-def]
            return dict.fromkeys(search_space, 0.0)

    study = optuna.create_study(sampler=MetricSampler(NAMES, metric(), Stuck(seed=1)))
    study.optimize(lambda trial: value(np.array([trial.suggest_float(each, 0.5, 2.0) for each in NAMES])), 160)
    moved = [trial.number for trial in study.trials if trial.number % UNIFORM_EVERY == 0]
    assert study.best_value < 0.3 * study.trials[0].value
    assert study.best_trial.number in moved


def test_sampler_without_a_curvature_has_all_that_the_bounds_allow() -> None:
    """As with measures that do not grow with the distance."""
    searcher = make_searcher("tpe", metric(None), 1, SamplerOptions(generation=40))
    searcher.ask()
    searcher.tell([Outcome(1.0, False, 100, ())])
    candidates = searcher.ask()
    assert np.ptp(candidates[:, 0]) > 1.0
    assert searcher.spread is None
    assert not searcher.finished()
