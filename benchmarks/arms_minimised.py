"""How far a sampler comes on an arm that is told the value of each trial and nothing else, for `benchmarks.arms`."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.arm_rigs import WITHIN, experiment_on, plant_of
from benchmarks.common import table
from metaid.compiled import Objective
from metaid.models.tree import ModelError, model_error
from metaid.search import SamplerOptions, arm_sensitivity, make_searcher, plain_coordinates, prior_metric
from metaid.study.settings import ARM_STEP

MINIMISERS = ("cmaes", "tpe", "optuna-cmaes")
FARTHEST = 10.0  # standard deviations of the prior: no base parameter beyond is tried


@dataclass(frozen=True)
class Minimised:
    """One arm and seed under a sampler that minimises: pushes of a trial, trials and how many of them fell, after how
    many the best had all errors within 1 %, None where none had; its value, what the measure can tell from none and the
    value of the true arm's law, in Hz; errors of the nominal arm and of the best trial, seconds.
    """

    arm: str
    seed: int
    sampler: str
    unknowns: int
    pushes: int
    trials: int
    falls: int
    trials_needed: int | None
    value: float
    resolution: float
    value_of_truth: float
    nominal: ModelError
    error: ModelError
    seconds: float


def minimise(name: str, seed: int, sampler: str, trials: int, noise: float, is_smooth: bool) -> Minimised:
    """Searches an arm by the value of each trial alone.

    Args:
        name: of the arm.
        seed: of what is wrong, of the starts, of the noise and of the sampler.
        sampler: by name.
        trials: at most; fewer where the sampler is finished.
        noise: of the angles, in rad.
        is_smooth: whether it has no dry friction.
    """
    plant = plant_of(name, seed, noise, is_smooth)
    prior, episode = experiment_on(plant, seed)
    reach = FARTHEST * np.sqrt(np.diag(prior.covariance))
    began = time.process_time()
    h = arm_sensitivity(prior, episode, plant.timestep)
    coordinates = prior_metric(h, prior, plain_coordinates(prior.values, prior.values - reach, prior.values + reach))
    searcher = make_searcher(sampler, coordinates, seed, SamplerOptions(sigma=ARM_STEP))
    objective = Objective(plant, prior, episode, "kinetic")
    number = falls = 0
    needed, best, error = None, np.inf, model_error(plant.tree, prior.nominal.parameters)
    nominal = error
    while number < trials and not searcher.finished():
        outcomes = []
        for values in searcher.ask()[: trials - number]:
            outcomes.append(objective.evaluate(values, number))
            number += 1
            falls += outcomes[-1].fell
            if not outcomes[-1].fell and outcomes[-1].value < best:
                best, error = outcomes[-1].value, model_error(plant.tree, prior.parameters_at(values))
                needed = (needed or number) if error.largest <= WITHIN else None
        if number < trials:
            searcher.tell(outcomes)
    return Minimised(
        arm=name,
        seed=seed,
        sampler=sampler,
        unknowns=len(prior.values),
        pushes=episode.npush,
        trials=number,
        falls=falls,
        trials_needed=needed,
        value=float(best),
        resolution=objective.measure.resolution(episode, plant.timestep),
        value_of_truth=objective.evaluate(prior.base.of(plant.tree.parameters), number).value,
        nominal=nominal,
        error=error,
        seconds=time.process_time() - began,
    )


def minimised_table(runs: Sequence[Minimised]) -> str:
    """A row for each arm and seed."""
    return table(
        [
            {
                "arm": run.arm,
                "seed": run.seed,
                "sampler": run.sampler,
                "base parameters": run.unknowns,
                "pushes a trial": run.pushes,
                "falls": run.falls,
                "pushes to 1 %": run.trials_needed * run.pushes if run.trials_needed else None,
                "pushes": run.trials * run.pushes,
                "error at the end": f"{run.error.largest:.2%}",
                "best, Hz": run.value,
                "under the true law, Hz": run.value_of_truth,
                "can be told, Hz": run.resolution,
                "seconds": round(run.seconds),
            }
            for run in runs
        ]
    )
