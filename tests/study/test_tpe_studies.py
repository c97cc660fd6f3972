"""TPE and the nominal metric on real chains, judged by the best trial itself, without the estimate's help."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
from chain_studies import chain_study, random_chain
from conftest import best_error
from optuna.samplers import CmaEsSampler, TPESampler
from optuna.trial import FrozenTrial

import metaid
from metaid.errors import StudyError
from metaid.store import Store
from metaid.study import Problem, create_study, load_study, run_study

pytestmark = pytest.mark.slow

CLOSE = 0.01


@pytest.mark.parametrize(("links", "seeds", "budget"), [(2, range(2), 150), (3, range(2), 250)])
def test_tpe_finds_random_chains(links: int, seeds: range, budget: int, tmp_path: Path) -> None:
    """Every lump that it searches to 1 %, in all of them."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    for seed in seeds:
        settings: dict[str, Any] = {"sampler": "tpe", "trials": budget, "seed": seed, "estimate": {"enabled": False}}
        name = create_study(store, chain_study(random_chain(links, seed), **settings), f"chain-{seed}")
        run_study(store, name)
        assert best_error(store, name) < CLOSE


def test_shipped_tpe_study_finds_its_lumps(tmp_path: Path) -> None:
    """To 1 %, in a third of its trials."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, load_study("two-link-tpe"), "study")
    run_study(store, "study", trials=130)
    assert best_error(store, "study") < CLOSE


@pytest.mark.parametrize("sampler", ["default", "tpe", "cmaes"])
def test_nominal_metric_sampler_finds_three_links_within_400_trials(sampler: str) -> None:
    """By each seed, in a plain Optuna study with Optuna's usual pruner; CMA-ES, which learns nothing of pruned
    trials, in one without.
    """
    spec = load_study("three-link-coast")
    problem = Problem(spec)
    truth = problem.open_plant().true_lumps()
    assert truth is not None
    true = truth.vector_of(problem.robot.lumps.searched) / problem.robot.lumps.vector
    objective = metaid.objective(spec)

    def error(study: optuna.Study) -> float:
        return float(np.abs(np.array([study.best_params[name] for name in objective.space]) / true - 1.0).max())

    def stop_when_close(study: optuna.Study, trial: FrozenTrial) -> None:
        if trial.number == study.best_trial.number and error(study) < CLOSE:
            study.stop()

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    for seed in range(1 if sampler == "cmaes" else 3):
        inner = {"tpe": TPESampler(seed=seed), "cmaes": CmaEsSampler(seed=seed, popsize=6), "default": None}[sampler]
        metric = metaid.NominalMetricSampler(spec, inner, seed=seed)
        study = optuna.create_study(sampler=metric, pruner=optuna.pruners.NopPruner() if sampler == "cmaes" else None)
        study.optimize(objective, 400, callbacks=[stop_when_close])
        assert error(study) < CLOSE


def test_nominal_metric_sampler_takes_a_name_or_the_objective() -> None:
    """And says in one line which studies have no metric."""
    objective = metaid.objective("two-link-tpe")
    for study in ("two-link-tpe", objective, objective.spec):
        optimized = optuna.create_study(sampler=metaid.NominalMetricSampler(study, seed=1))
        optimized.optimize(objective, 2)
        assert optimized.trials[0].params == objective.start
    with pytest.raises(StudyError, match="there is no nominal metric"):
        metaid.NominalMetricSampler(
            load_study("three-link-coast", {"episode.measure": "crossing", "search.coordinates": "plain"})
        )
