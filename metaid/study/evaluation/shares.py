"""A batch in shares for workers that may be lost: who gets what, and when a candidate is given up.

Nobody knows which candidate of a share ended its worker, or whether any did. So those of a lost share go out once more,
each alone; one that costs `TRIES` workers while it is alone cannot be evaluated.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from metaid.episode import Outcome
from metaid.study.problem import Problem

TRIES = 3


@dataclass(frozen=True)
class Share:
    """Rows of a batch for one worker; `alone` if it is one that was in a share that was lost."""

    candidates: tuple[int, ...]
    alone: bool = False


class Shares:
    """The shares of a batch of `size` candidates, `count` of them at first, and what came of those that are done."""

    def __init__(self, problem: Problem, size: int, count: int) -> None:
        self._problem = problem
        self._size = size
        self._waiting = deque(Share(tuple(range(first, size, count))) for first in range(min(count, size)))
        self._lost = [0] * size
        self._outcomes: dict[int, Outcome] = {}

    def take(self) -> Share | None:
        """A share to be evaluated; None where there is none left."""
        return self._waiting.popleft() if self._waiting else None

    def done(self, share: Share, outcomes: Sequence[Outcome]) -> None:
        """Takes in the `outcomes` of a share, in its order."""
        self._outcomes.update(zip(share.candidates, outcomes, strict=True))

    def lose(self, share: Share, reason: str) -> None:
        """Takes back a share whose worker was lost for that `reason`, or gives its candidate up."""
        for candidate in share.candidates:
            self._lost[candidate] += share.alone
            if self._lost[candidate] < TRIES:
                self._waiting.append(Share((candidate,), alone=True))
            else:
                self._outcomes[candidate] = self._problem.failed(f"{reason}, {TRIES} times")

    @property
    def outcomes(self) -> list[Outcome] | None:
        """The outcomes of the batch in its order; None until all are there."""
        if len(self._outcomes) < self._size:
            return None
        return [self._outcomes[candidate] for candidate in range(self._size)]
