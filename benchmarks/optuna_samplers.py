"""Optuna's samplers at equal trials, in the factors and in the nominal metric: the best trial's worst lump.

    python -m benchmarks.optuna_samplers
    python -m benchmarks.optuna_samplers --links 2 --samplers TPE --seeds 0 1 --json

Each is what a user of Optuna writes: `study.optimize(metaid.objective(...))`, without a pruner, the first trial at the
start. In the metric it is within a `metaid.NominalMetricSampler`. The chains are those of benchmarks/chains.py. GP
needs torch, and is left out where that is missing.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from statistics import median

import numpy as np
import optuna
from optuna.samplers import BaseSampler, CmaEsSampler, GPSampler, QMCSampler, RandomSampler, TPESampler
from threadpoolctl import threadpool_limits

import metaid
from benchmarks.chains import random_chain
from benchmarks.samplers import options, trials_to
from metaid.plant import PlantSettings, chain_of
from metaid.study import StudySettings, StudySpec

BUDGETS = {2: 100, 3: 200, 5: 400}
SAMPLERS: dict[str, Callable[[int], BaseSampler]] = {
    "random": lambda seed: RandomSampler(seed=seed),
    "QMC": lambda seed: QMCSampler(seed=seed, warn_independent_sampling=False),
    "GP": lambda seed: GPSampler(seed=seed),
    "CMA-ES": lambda seed: CmaEsSampler(seed=seed, warn_independent_sampling=False),
    "TPE": lambda seed: TPESampler(seed=seed),
}
SLOW = "GP"  # its trials take longer and longer: up to three links only


def errors_of(links: int, seed: int, sampler: str, in_metric: bool) -> list[float]:
    """The error of the worst lump of the trial that is the best so far, after each trial."""
    true, nominal = random_chain(links, seed)
    study_settings = StudySettings.model_validate(
        {"plant": "chain", "nominal": "nominal", "sampler": "cmaes", "trials": BUDGETS[links], "seed": seed}
    )
    plant = PlantSettings(links=true)
    spec = StudySpec(name="chain", plant_name="chain", plant=plant, nominal=nominal, study=study_settings)
    truth = chain_of(true).lumps.vector / chain_of(nominal).lumps.vector
    objective, made = metaid.objective(spec), SAMPLERS[sampler](seed)
    chosen = metaid.NominalMetricSampler(spec, made) if in_metric else made
    study = optuna.create_study(sampler=chosen, pruner=optuna.pruners.NopPruner())
    study.enqueue_trial(objective.start)
    study.optimize(objective, BUDGETS[links])
    best, errors = np.inf, [np.inf]
    for trial in study.trials:
        error = errors[-1]
        if trial.state == optuna.trial.TrialState.COMPLETE and trial.value is not None and trial.value < best:
            best = trial.value
            error = float(np.abs(np.array([trial.params[name] for name in objective.space]) / truth - 1.0).max())
        errors.append(error)
    return errors[1:]


def table(results: dict[tuple[int, str, bool], list[list[float]]]) -> str:
    """Medians over the seeds, as a Markdown table."""
    lines = ["| links | trials | sampler | searches in | within 1 % | trials to 1 % | error at the end |"]
    lines.append("| --- " * 7 + "|")
    for (links, sampler, in_metric), runs in results.items():
        reached = [trials for errors in runs if (trials := trials_to(errors, 0.01)) is not None]
        middle = f"{median(reached):,.0f}" if len(reached) > len(runs) / 2 else "–"
        where = "the metric" if in_metric else "the factors"
        end = median(errors[-1] for errors in runs)
        cells = str(links), str(BUDGETS[links]), sampler, where, f"{len(reached)} of {len(runs)}", middle, f"{end:.3%}"
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Runs the comparison and prints its table or JSON."""
    given = options(__doc__, BUDGETS, SAMPLERS).parse_args()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
    results = {}
    with threadpool_limits(1):
        for links in given.links:
            for in_metric in (False, True):
                for sampler in given.samplers:
                    if sampler == SLOW and (links > 3 or find_spec("torch") is None):
                        continue
                    if in_metric and sampler == "QMC":
                        continue  # a sequence that fills a box is none where the box moves
                    print(f"{links} links, {sampler}, {in_metric}", file=sys.stderr)
                    runs = [errors_of(links, seed, sampler, in_metric) for seed in given.seeds]
                    results[links, sampler, in_metric] = runs
    if given.json:
        rows = [
            {"links": links, "sampler": sampler, "in_metric": in_metric, "errors": runs}
            for (links, sampler, in_metric), runs in results.items()
        ]
        print(json.dumps(rows))
    else:
        print(table(results))


if __name__ == "__main__":
    main()
