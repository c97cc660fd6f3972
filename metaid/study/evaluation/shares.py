"""A batch in shares for workers that may be lost: which share is next, and when a candidate is given up.

Which candidate of a share ended its worker cannot be known, nor whether any did. So the candidates of a lost share are
evaluated again, each alone. One that is alone when its worker is lost, LOSSES_ALLOWED times, cannot be evaluated.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from metaid.episode import Outcome
from metaid.study.problem import Problem

MOST_SHARED = 512  # candidates that workers share at most before their outcomes are taken in: it bounds the memory
LOSSES_ALLOWED = 3  # workers that a candidate may be alone with when they are lost, before it is given up


@dataclass(frozen=True)
class Share:
    """The rows `candidates` of a batch, for one worker; `alone` if it is one candidate of a share that was lost."""

    candidates: tuple[int, ...]
    alone: bool = False


class Shares:
    """The shares of a batch of `size` candidates, `count` of them at first, and the outcomes so far."""

    def __init__(self, problem: Problem, size: int, count: int) -> None:
        self._problem = problem
        self._size = size
        self._waiting = deque(Share(tuple(range(first, size, count))) for first in range(min(count, size)))
        self._losses = [0] * size
        self._outcomes: dict[int, Outcome] = {}

    def take(self) -> Share | None:
        """The next share to be evaluated; None where there is none left."""
        return self._waiting.popleft() if self._waiting else None

    def finish(self, share: Share, outcomes: Sequence[Outcome]) -> None:
        """Takes in the `outcomes` of a share, in the order of its candidates."""
        self._outcomes.update(zip(share.candidates, outcomes, strict=True))

    def lose(self, share: Share, reason: str) -> None:
        """Puts the candidates of a share back whose worker was lost for that `reason`, or gives its candidate up."""
        for candidate in share.candidates:
            self._losses[candidate] += share.alone
            if self._losses[candidate] < LOSSES_ALLOWED:
                self._waiting.append(Share((candidate,), alone=True))
            else:
                self._outcomes[candidate] = self._problem.failed(f"{reason}, {LOSSES_ALLOWED} times")

    @property
    def outcomes(self) -> list[Outcome] | None:
        """The outcomes of the batch in its order; None until all are there."""
        if len(self._outcomes) < self._size:
            return None
        return [self._outcomes[candidate] for candidate in range(self._size)]
