"""Who evaluates a generation: what every crew answers to, and threads over the compiled loop.

Each worker has an objective, and so a plant, of its own. An outcome depends on its candidate alone, so it does not
matter who evaluates it.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Protocol

from metaid.episode import Outcome
from metaid.models import Array
from metaid.study.problem import Problem

SHARED = 512  # candidates that the workers share at most before their results are taken in: it bounds the memory


def nothing() -> None:
    """What a crew does meanwhile unless it is told."""
    return


class Evaluator(Protocol):
    """A context manager that evaluates batches."""

    def evaluate(self, batch: Array, meanwhile: Callable[[], None] = nothing) -> list[Outcome]:
        """Outcomes of a `batch` of factors (ncandidate x nlump), in its order; calls `meanwhile` while it waits."""

    def __enter__(self) -> Evaluator: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class ThreadEvaluator:
    """Threads: the compiled loop releases the GIL."""

    def __init__(self, problem: Problem, workers: int) -> None:
        self._objectives = [problem.make_objective() for _ in range(workers)]
        self._pool = ThreadPoolExecutor(workers, thread_name_prefix="metaid")

    def evaluate(self, batch: Array, meanwhile: Callable[[], None] = nothing) -> list[Outcome]:
        shares = [batch[first : first + SHARED] for first in range(0, len(batch), SHARED)]
        outcomes: list[Outcome] = []
        for share in shares:
            shared = self._objectives[0].share(share)
            working = [self._pool.submit(objective.work_on, shared) for objective in self._objectives]
            meanwhile()
            for worker in working:
                worker.result()
            outcomes += self._objectives[0].outcomes(shared)
        return outcomes

    def __enter__(self) -> ThreadEvaluator:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for objective in self._objectives:
            objective.close()
        self._pool.shutdown(cancel_futures=True)
