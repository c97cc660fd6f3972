"""What Optuna's samplers learn of a generation."""

from __future__ import annotations

import numpy as np
import optuna
from optuna.trial import TrialState

from metaid.episode.outcome import Outcome
from metaid.search.coordinates import plain_coordinates
from metaid.search.optuna_samplers import OptunaSampler
from metaid.search.searcher import GenerationOptions


class Witness(optuna.samplers.RandomSampler):
    """A sampler that keeps the trials that Optuna shows it before it proposes the next."""

    seen: list[optuna.trial.FrozenTrial]

    def before_trial(self, study: optuna.Study, trial: optuna.trial.FrozenTrial) -> None:
        self.seen = study.get_trials(states=(TrialState.COMPLETE, TrialState.PRUNED))


def test_sampler_is_shown_falls_as_pruned_at_the_step_that_they_survived_to() -> None:
    """Samplers rank pruned trials by their last step, so a late fall must not pass for an early one."""
    witness = Witness(seed=0)
    coordinates = plain_coordinates(np.ones(1), np.full(1, 0.5), np.full(1, 2.0))
    options = GenerationOptions(generation=3)
    searcher = OptunaSampler(coordinates, lambda seed: witness, 0, options)
    searcher.ask()
    searcher.tell([Outcome(7.0, True, 12, (0,)), Outcome(6.0, True, 80, (0,)), Outcome(1.0, False, 100, (2,))])
    searcher.ask()
    assert [trial.state for trial in witness.seen] == [TrialState.PRUNED, TrialState.PRUNED, TrialState.COMPLETE]
    assert [trial.intermediate_values for trial in witness.seen] == [{12: 7.0}, {80: 6.0}, {100: 1.0}]
