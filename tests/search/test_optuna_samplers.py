"""What Optuna's samplers learn of a generation, and what they propose."""

from __future__ import annotations

import numpy as np
import optuna
import pytest
from optuna.trial import TrialState

from metaid.episode import Outcome
from metaid.search import Coordinates, SamplerOptions, make_searcher, plain_coordinates
from metaid.search.optuna_samplers import OptunaSampler


class Witness(optuna.samplers.RandomSampler):
    """A sampler that keeps the trials that Optuna shows it before it proposes the next."""

    seen: list[optuna.trial.FrozenTrial]

    def before_trial(self, study: optuna.Study, trial: optuna.trial.FrozenTrial) -> None:
        self.seen = study.get_trials(states=(TrialState.COMPLETE, TrialState.PRUNED))


def test_sampler_is_shown_falls_as_pruned_at_the_step_that_they_survived_to() -> None:
    """Samplers rank pruned trials by their last step, so a late fall must not pass for an early one."""
    witness = Witness(seed=0)
    coordinates = plain_coordinates(np.ones(1), np.full(1, 0.5), np.full(1, 2.0))
    searcher = OptunaSampler(coordinates, witness, 3)
    searcher.ask()
    searcher.tell([Outcome(7.0, True, 12, (0,)), Outcome(6.0, True, 80, (0,)), Outcome(1.0, False, 100, (2,))])
    searcher.ask()
    assert [trial.state for trial in witness.seen] == [TrialState.PRUNED, TrialState.PRUNED, TrialState.COMPLETE]
    assert [trial.intermediate_values for trial in witness.seen] == [{12: 7.0}, {80: 6.0}, {100: 1.0}]


def two_factors() -> Coordinates:
    """With bounds of their own."""
    return plain_coordinates(np.ones(2), np.array([0.5, 0.8]), np.array([2.0, 1.1]))


@pytest.mark.parametrize("sampler", ["tpe", "random", "optuna-cmaes"])
def test_candidates_are_within_the_bounds_and_follow_from_the_seed(sampler: str) -> None:
    """Over several generations with falls among them; another seed proposes others."""

    def tried(seed: int) -> np.ndarray:
        searcher = make_searcher(sampler, two_factors(), seed, SamplerOptions())
        generations = []
        for _ in range(4):
            generations.append(searcher.ask())
            assert len(generations[-1]) > 1 or len(generations) == 1
            outcomes = [Outcome(float(f.sum()), bool(f[0] < 0.8), int(100 * f[0]), ()) for f in generations[-1]]
            searcher.tell(outcomes)
            assert not searcher.finished()
        return np.concatenate(generations)

    one, same, other = tried(1), tried(1), tried(2)
    assert (one == same).all()
    assert (one != other).any()
    assert ((one >= two_factors().low) & (one <= two_factors().high)).all()


def test_generation_is_as_large_as_the_study_says() -> None:
    """Whatever the default is."""
    assert len(make_searcher("random", two_factors(), 1, SamplerOptions()).ask()) == 8
    for sampler in ("random", "tpe", "optuna-cmaes"):
        searcher = make_searcher(sampler, two_factors(), 1, SamplerOptions(generation=5))
        if sampler != "random":  # it begins with the start alone
            searcher.ask()
            searcher.tell([Outcome(1.0, False, 100, ())])
        assert len(searcher.ask()) == 5
