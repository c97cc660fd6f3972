"""What an estimate costs: one fit over the episodes of one trial, and the windows that it is made of.

A trial is what a study of these chains evaluates, 2N rich pushes with the first law of `output-error`. `first` is the
fit of that trial alone, `second` that of it and the trial at the estimate, from where the first ended. Noisy plants
have 1 mrad on the angles and no speed sensor. Trials and fits take turns, on as many threads as metaid uses.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from threadpoolctl import threadpool_limits

from benchmarks.common import PLANTS, Row, interleaved, made, make_spec, run_alone
from metaid.compiled import CompiledLoop
from metaid.episode import Outcome
from metaid.models import Array
from metaid.plant import FaultSettings
from metaid.store import Store, Trial
from metaid.store.motion import windows_text
from metaid.study import EpisodeSettings, Problem, SearchSettings, StudySpec

LINKS = (2, 3, 5, 10)
NOISE = FaultSettings(angle_noise=1e-3, speed_sensor=False)
TRIALS = 32  # that are written at once, with windows and without
SHOTS = 50  # episodes that are timed together


def measure(quick: bool) -> dict[str, list[Row]]:
    """A table of fits, and one of what windows cost."""
    with threadpool_limits(1):
        fits = [_fit_row(n, noisy, quick) for noisy in (False, True) for n in LINKS]
        return {
            "Fits: milliseconds, and ratios to the episodes of one trial": fits,
            "Windows: the engine with them over the engine without, and what a trial with them costs more in the DB": [
                _window_row(n, quick) for n in PLANTS
            ],
        }


def matching_spec(nlink: int, noisy: bool = False) -> StudySpec:
    """A study of the shipped chain of `nlink` links by `output-error`, in its own episodes."""
    spec = make_spec(nlink, sampler="output-error")
    episode = EpisodeSettings(measure="smoothed") if noisy else EpisodeSettings()
    study = spec.study.model_copy(update={"episode": episode, "search": SearchSettings()})
    plant = spec.plant.model_copy(update={"faults": NOISE}) if noisy else spec.plant
    return spec.model_copy(update={"study": study, "plant": plant})


def _fit_row(nlink: int, noisy: bool, quick: bool) -> Row:
    problem = Problem(matching_spec(nlink, noisy))
    experiment, objective = problem.experiment(), problem.make_objective()
    assert experiment is not None
    first = problem.make_searcher().ask()[0]
    shown = experiment.trial(first, objective.evaluate(first))
    assert shown is not None
    estimate = experiment.estimate([shown])
    assert estimate is not None
    at_estimate = experiment.factors(estimate)
    coasting = experiment.trial(at_estimate, objective.evaluate(at_estimate))
    assert coasting is not None
    trials = [shown, coasting]
    work: dict[str, Callable[[], object]] = {
        "trial": partial(objective.evaluate, first),
        "first": partial(experiment.estimate, [shown]),
        "second": partial(experiment.estimate, trials, estimate),
    }
    work["second"]()
    taken = interleaved(work, 3 if quick else 31)
    return {
        "links": nlink,
        "unknowns": len(estimate.names),
        "plant": "noisy" if noisy else "ideal",
        "trial, ms": 1e3 * taken["trial"],
        "first fit, ms": 1e3 * taken["first"],
        "second fit, ms": 1e3 * taken["second"],
        "first ÷ trial": taken["first"] / taken["trial"],
        "second ÷ trial": taken["second"] / taken["trial"],
        "steps of the first fit": estimate.iterations,
    }


def _window_row(nlink: int, quick: bool) -> Row:
    problem = Problem(matching_spec(nlink))
    plant, law, episode = problem.open_plant(), problem.nominal.lumps, problem.episode
    loops = {
        "with": CompiledLoop(plant, episode),
        "without": CompiledLoop(plant, replace(episode, window_ends=())),
    }
    for loop in loops.values():
        loop.run(law)

    def shots(loop: CompiledLoop) -> None:
        for _ in range(SHOTS):
            loop.run(law)

    taken = interleaved({name: partial(shots, loop) for name, loop in loops.items()}, 3 if quick else 61)
    factors = problem.make_searcher().ask()[0]
    outcome = problem.make_objective().evaluate(factors)
    assert outcome.windows is not None
    written = _written(problem, factors, [outcome, replace(outcome, windows=None)], 3 if quick else 31)
    return {
        "links": nlink,
        "engine with ÷ without": taken["with"] / taken["without"],
        "loop, ms a trial": 1e3 * (taken["with"] - taken["without"]) / SHOTS,
        "DB, ms a trial": 1e3 * (written[0] - written[1]),
        "DB, kB a trial": 1e-3 * len(windows_text(outcome.windows)),
    }


def _written(problem: Problem, factors: Array, outcomes: Sequence[Outcome], repeats: int) -> list[float]:
    """Median CPU seconds a trial that it takes to write each of the `outcomes`, TRIALS times at once, by turns."""
    taken: list[list[float]] = [[] for _ in outcomes]
    for _ in range(repeats):
        for outcome, times in zip(outcomes, taken, strict=True):
            with made(problem.spec) as (store, name):
                times.append(_append(store, name, problem, [Trial(i, i, factors, outcome) for i in range(TRIALS)]))
    return [statistics.median(times) / TRIALS for times in taken]


def _append(store: Store, name: str, problem: Problem, trials: list[Trial]) -> float:
    began = time.process_time()
    store.append(name, problem.names, problem.low, problem.high, trials)
    return time.process_time() - began


if __name__ == "__main__":
    run_alone("fits", measure)
