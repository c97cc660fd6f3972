"""Threads as workers: the compiled loop releases the GIL."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Semaphore
from typing import Any

from metaid.episode import Outcome
from metaid.models import Array
from metaid.study.evaluation.shares import MOST_SHARED
from metaid.study.problem import Problem


class ThreadEvaluator:
    """As many threads as `workers`, each with an objective, and so a plant, of its own."""

    def __init__(self, problem: Problem, workers: int) -> None:
        self._objectives = [problem.make_objective() for _ in range(workers)]
        self._pool = ThreadPoolExecutor(workers, thread_name_prefix="metaid")
        self._at_work = Semaphore(0)

    def evaluate(self, batch: Array, first: int = 0, while_waiting: Callable[[], None] = lambda: None) -> list[Outcome]:
        """Outcomes of a `batch` of factors (ncandidate x nsearched), in its order; `first` is the number of the first
        one's trial. `while_waiting` is called while the workers are at work.
        """
        outcomes: list[Outcome] = []
        for begin in range(0, len(batch), MOST_SHARED):
            candidates = batch[begin : begin + MOST_SHARED]
            shared = self._objectives[0].share(candidates, range(first + begin, first + begin + len(candidates)))
            working = [self._pool.submit(self._work_on, shared, objective) for objective in self._objectives]
            for _ in working:  # else they would wait for the GIL until this thread waits for something
                self._at_work.acquire()
            while_waiting()
            for worker in working:
                worker.result()
            outcomes += self._objectives[0].outcomes(shared)
        return outcomes

    def _work_on(self, shared: Any, objective: Any) -> None:
        self._at_work.release()
        objective.work_on(shared)

    def close(self) -> None:
        """Ends the workers."""
        for objective in self._objectives:
            objective.close()
        self._pool.shutdown(cancel_futures=True)
