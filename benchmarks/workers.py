"""What a second worker gains, with threads and with Ray, and what Ray costs over threads.

The same batches of full episodes for all, by turns: one generation after another, as in a study, with nothing else in
between. All are compared with one thread that took its turns among them. Ray's start is timed apart; its own processes
are busy for some seconds more, and are given those.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.common import START, Row, interleaved, make_spec, run_alone
from metaid.models import Array
from metaid.study import Problem
from metaid.study.evaluation import Evaluator, make_evaluator

GENERATIONS = (16, 256)  # candidates in a batch
CANDIDATES = 256  # in all, in each turn
SETTLING = 10.0  # s that Ray's own processes are given after its start


def measure(quick: bool) -> dict[str, list[Row]]:
    """One row a evaluator and generation."""
    problem = Problem(make_spec(3))
    rows: list[Row] = []
    with threadpool_limits(1):
        for workers in (1, 2):
            rows += _rows(problem, workers, 2 if quick else 21, 0.0 if quick else SETTLING)
    one = {(row["engine"], row["generation"]): row["÷ one thread"] for row in rows if row["workers"] == 1}
    local = {(row["workers"], row["generation"]): row["÷ one thread"] for row in rows if row["engine"] == "local"}
    for row in rows:
        row["÷ one worker"] = row["÷ one thread"] / one[row["engine"], row["generation"]]
        row["÷ local"] = row["÷ one thread"] / local[row["workers"], row["generation"]]
    return {"Workers: trials per second, three links, 5,000-step episodes": rows}


def _batches(problem: Problem, generation: int) -> Array:
    shape = (CANDIDATES // generation, generation, len(problem.names))
    return np.random.default_rng(0).uniform(START - 0.1, START + 0.1, shape)


def _evaluate_all(evaluator: Evaluator, batches: Array) -> None:
    for batch in batches:
        evaluator.evaluate(batch)


def _rows(problem: Problem, workers: int, repeats: int, settling: float) -> list[Row]:
    rows: list[Row] = []
    with ExitStack() as stack:
        begun = time.perf_counter()
        ray = stack.enter_context(closing(make_evaluator(problem, "ray", workers)))
        ray.evaluate(_batches(problem, GENERATIONS[0])[0])
        started = time.perf_counter() - begun
        time.sleep(settling)
        evaluators: dict[str, Evaluator] = {
            "one thread": stack.enter_context(closing(make_evaluator(problem, "local", 1))),
            "ray": ray,
        }
        if workers > 1:
            evaluators["local"] = stack.enter_context(closing(make_evaluator(problem, "local", workers)))
        for generation in GENERATIONS:
            batches = _batches(problem, generation)
            works: dict[str, Callable[[], object]] = {
                name: partial(_evaluate_all, evaluator, batches) for name, evaluator in evaluators.items()
            }
            interleaved(works, 1)
            taken = interleaved(works, repeats)
            taken.setdefault("local", taken["one thread"])
            rows += [
                {
                    "engine": engine,
                    "workers": workers,
                    "generation": generation,
                    "trials/s": CANDIDATES / taken[engine],
                    "÷ one thread": taken["one thread"] / taken[engine],
                    "start, s": started if engine == "ray" else None,
                }
                for engine in ("local", "ray")
            ]
    return rows


if __name__ == "__main__":
    run_alone("workers", measure)
