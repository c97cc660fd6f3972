"""Trials per second from end to end, against `plain_optuna.py` on SQLite and in memory, on the same episodes.

A trial is: ask, an episode of 5,000 steps, tell, and all of it in the DB. Both search with CMA-ES from the same start
in the same bounds, with two threads. There is no fall here, for a fall ends an episode, and who happens upon more of
them would seem to be faster; a candidate that diverges still ends its own, so the ratio is that of steps per second.
"""

from __future__ import annotations

import statistics
import tempfile
import time

import numpy as np

from benchmarks import plain_optuna
from benchmarks.common import START, Row, made, make_spec, run_alone
from metaid.study import Problem, StudySpec, run_study

TRIALS = 800  # of ours, in each run
WARM_UP = 20


def measure(quick: bool) -> dict[str, list[Row]]:
    """Three rows a chain."""
    rows = [row for nlink in (3, 5) for row in _rows(nlink, quick)]
    return {"Study: trials per second, 5,000-step episodes, two workers": rows}


def task_of(spec: StudySpec) -> plain_optuna.Task:
    """The same chain, pushes and nominal lumps for the plain script."""
    problem = Problem(spec)
    plant, nominal = problem.open_plant(), problem.nominal.lumps
    chain, episode = plant.chain, problem.episode
    start = np.array([plant.start_speeds(start) for start in episode.starts])
    links = chain.length, chain.mass, chain.com, chain.inertia
    return plain_optuna.Task(
        *links,
        plant.gravity,
        plant.timestep,
        nominal.gravity,
        nominal.coriolis,
        start,
        episode.steps,
        episode.fall_rule.limit,
        START,
    )


def check_same(spec: StudySpec) -> None:
    """That both give the same candidates the same value to eight digits and the same falls at the same step."""
    theirs, ours, random = (
        plain_optuna.Objective(task_of(spec)),
        Problem(spec).make_objective(),
        np.random.default_rng(0),
    )
    for centre in (START, START, 1.0):
        factors = random.uniform(centre - 0.1, centre + 0.1, len(theirs.names))
        (value, steps), outcome = theirs.episode(factors), ours.evaluate(factors)
        assert steps == outcome.steps, "the episodes differ"
        assert (value is None) == outcome.fell, "the falls differ"
        assert value is None or abs(value - outcome.value) < 1e-8 * value, "the values differ"


def _rows(nlink: int, quick: bool) -> list[Row]:
    spec = make_spec(nlink, trials=TRIALS // (10 if quick else 1) + WARM_UP)
    check_same(spec)
    their_trials = 6 if quick else 60  # in each run; more would be slower still on SQLite
    repeats = 1 if quick else 3
    runs: dict[str, list[tuple[float, float]]] = {"metaid": [], "plain_optuna, SQLite": [], "plain_optuna, memory": []}
    for _ in range(repeats):
        runs["metaid"].append(_ours(spec))
        with tempfile.TemporaryDirectory() as folder:
            theirs = _theirs(spec, their_trials, f"sqlite:///{folder}/plain.db")
            runs["plain_optuna, SQLite"].append(theirs)
        runs["plain_optuna, memory"].append(_theirs(spec, their_trials, None))
    ours = statistics.median(rate * steps for rate, steps in runs["metaid"])
    rows = []
    for name, pairs in runs.items():
        rate, steps = (statistics.median(column) for column in zip(*pairs, strict=True))
        row = {"links": nlink, "lumps": nlink * (nlink + 1) // 2, "script": name, "trials/s": rate}
        rows.append(
            row | {"steps a trial": steps, "steps/s": rate * steps, "metaid is faster by": ours / (rate * steps)}
        )
    return rows


def _ours(spec: StudySpec) -> tuple[float, float]:
    with made(spec) as (store, name):
        marks: list[tuple[float, int]] = []
        run_study(store, name, trials=WARM_UP)  # threads, compiled code and the plant are there from then on
        run_study(store, name, watch=lambda progress: marks.append((time.perf_counter(), progress.trials)))
        (begun, first), (ended, last) = marks[0], marks[-1]  # without the estimate at the end: plain Optuna has none
        trials = store.trials(name, Problem(spec).names)[first:last]
        return len(trials) / (ended - begun), statistics.mean(trial.outcome.steps for trial in trials)


def _theirs(spec: StudySpec, trials: int, storage: str | None) -> tuple[float, float]:
    begun = time.perf_counter()
    _, objective = plain_optuna.run(task_of(spec), trials, storage)
    return trials / (time.perf_counter() - begun), objective.steps / trials


if __name__ == "__main__":
    run_alone("study", measure)
