"""What evaluates the candidates of a generation, wherever that is done.

An outcome depends on its candidate and the number of its trial alone, so it does not matter which worker evaluates it.
"""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Protocol

from metaid.episode import Outcome
from metaid.models import Array

MOST_SHARED = 512  # candidates that workers share at most before their outcomes are taken in: it bounds the memory


def do_nothing() -> None:
    """What is done by default while the workers are at work."""
    return


class Evaluator(Protocol):
    """A context manager that evaluates batches of candidates; its workers end with it."""

    def evaluate(self, batch: Array, first: int = 0, while_waiting: Callable[[], None] = do_nothing) -> list[Outcome]:
        """Outcomes of candidates, in their order.

        Args:
            batch: their factors (ncandidate x nsearched).
            first: the number of the first one's trial; the others' follow.
            while_waiting: called while the workers are at work.

        Raises:
            WorkerError: there are no workers for too long.
        """

    def __enter__(self) -> Evaluator: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
