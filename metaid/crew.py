"""Who evaluates a generation: what every crew answers to, and threads over the compiled loop.

Each worker has an objective, and so a plant, of its own. An outcome depends on its candidate alone, so it does not
matter who evaluates it.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Protocol

from metaid.chain import Array
from metaid.objective import Objective, Outcome
from metaid.problem import Problem


def nothing() -> None:
    """What a crew does meanwhile unless it is told."""
    return


class Crew(Protocol):
    """A context manager that evaluates batches."""

    def evaluate(self, batch: Array, meanwhile: Callable[[], None] = nothing) -> list[Outcome]:
        """Outcomes of a `batch` of factors (ncandidate x nlump), in its order; calls `meanwhile` while it waits."""

    def __enter__(self) -> Crew: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class LocalCrew:
    """Threads: the compiled loop releases the GIL."""

    def __init__(self, problem: Problem, workers: int) -> None:
        self._objectives = [problem.make_objective() for _ in range(workers)]
        self._pool = ThreadPoolExecutor(workers, thread_name_prefix="metaid")

    def evaluate(self, batch: Array, meanwhile: Callable[[], None] = nothing) -> list[Outcome]:
        outcomes: list[Outcome | None] = [None] * len(batch)
        queue = iter(range(len(batch)))  # `next` on it is atomic, so each candidate goes to whoever is free first

        def work(objective: Objective) -> None:
            for i in queue:
                outcomes[i] = objective.evaluate(batch[i])

        working = [self._pool.submit(work, objective) for objective in self._objectives]
        meanwhile()
        for worker in working:
            worker.result()
        return [outcome for outcome in outcomes if outcome is not None]

    def __enter__(self) -> LocalCrew:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pool.shutdown(cancel_futures=True)
