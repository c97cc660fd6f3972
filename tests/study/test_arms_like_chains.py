"""What studies of chains can do, those of arms can: plain Optuna, and runs until intervals are narrow."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import optuna
import pytest
from arm_studies import ARM, spec_of, with_noise
from optuna.trial import TrialState

import metaid
from metaid.errors import StudyError
from metaid.results import read_snapshot
from metaid.store import Store
from metaid.study import create_study, forecast, problem_of, run_study


def test_arm_is_an_objective_of_plain_optuna() -> None:
    """A trial suggests base parameters, reports the measure after each push, and may be pruned after one."""
    objective = metaid.objective(ARM)
    sampler = metaid.NominalMetricSampler(ARM, seed=0)
    study = optuna.create_study(sampler=sampler, pruner=optuna.pruners.ThresholdPruner(upper=0.3))
    study.enqueue_trial(objective.start)
    study.optimize(objective, n_trials=12)
    first, problem = study.trials[0], problem_of(spec_of())
    assert first.state == TrialState.COMPLETE
    assert first.value == metaid.evaluate(ARM).value
    assert len(first.intermediate_values) == problem.episode.npush
    assert first.intermediate_values[max(first.intermediate_values)] == pytest.approx(first.value)
    pruned = [each for each in study.trials if each.state == TrialState.PRUNED]
    assert pruned
    assert all(max(each.intermediate_values) <= problem.episode.total_steps for each in pruned)
    assert study.best_value <= first.value


def test_run_of_an_arm_ends_once_its_torques_are_known(tmp_path: Path) -> None:
    """With 95 % the torque of each joint is within what was asked for, and a narrower wish takes more trials."""
    store, trials = Store(str(tmp_path / "arm.db"), create=True), []
    for number, until in enumerate((0.01, 0.0003)):
        spec = with_noise(spec_of(trials=8), 1e-4)
        name = create_study(store, spec, f"arm-{number}")
        trials.append(run_study(store, name, until=until).trials)
        found = read_snapshot(store, name).estimate
        assert found.half_width <= until
        problem = problem_of(spec)
        true, base = spec.plant.arm.tree, problem.robot.prior.base
        off = base.of(true.parameters) - found.estimate.values
        assert np.abs(off / found.deviations).max() < 4.5
    assert trials[0] < trials[1]


def test_forecast_of_an_arm_says_how_many_trials_are_needed() -> None:
    """By its nominal arm; what no sampler by estimates can reach is refused."""
    noisy = with_noise(spec_of(trials=8), 1e-4)
    few, many = (forecast(problem_of(noisy), until) for until in (0.01, 0.0002))
    assert few.is_reached
    assert few.trials < many.trials
    assert few.pushes == few.trials * problem_of(noisy).episode.npush
    with pytest.raises(StudyError, match="sampler 'cmaes' does not work by intervals"):
        forecast(problem_of(spec_of(sampler="cmaes")), 0.01)
