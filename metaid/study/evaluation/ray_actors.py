"""Ray actors as a crew, on this machine or on a cluster.

Actors come and go: they are given work as soon as they are placed, and one that dies, or does not answer in time, is
replaced while the others go on with its candidates (`shares`).
"""

from __future__ import annotations

import logging
import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from metaid.episode import Outcome
from metaid.errors import MetaidError, StudyError, WorkerError
from metaid.models import Array
from metaid.study.evaluation.ray_private import ray_on_loopback
from metaid.study.evaluation.shares import Share, Shares
from metaid.study.evaluation.threads import SHARED, nothing
from metaid.study.problem import Problem
from metaid.study.settings import StudySpec

PATIENCE = 120.0  # s
SLOWER = 100.0  # times the slowest candidate so far: so long a worker may take, be it beyond its patience
TICK = 1.0  # s between two looks at the workers
ANNOUNCED = 10.0  # s without a worker, after which it is said: Ray needs some 5 to start

TOKEN = Path.home() / ".ray" / "auth_token"

log = logging.getLogger("metaid")


@dataclass(eq=False)
class _Actor:
    """An actor; what it is `at`, first its start; the `share` that it has; how long it was `watched` at it (s); the
    node and process where it is, once it has started.
    """

    actor: Any
    at: Any
    share: Share | None = None
    watched: float = 0.0
    place: tuple[str, int] | None = None


class RayEvaluator:
    """Ray actors, each with an objective; a batch is sent in one call per actor.

    A worker that takes longer than `patience` (s) for its share is replaced, or longer than SLOWER times what the
    slowest candidates so far would have taken; for as long a batch waits while there is no worker at all.
    """

    def __init__(self, problem: Problem, workers: int, address: str | None, patience: float = PATIENCE) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
        if address is not None and (TOKEN.exists() or {"RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH"} & set(os.environ)):
            os.environ.setdefault("RAY_AUTH_MODE", "token")  # as `ray start` does
        import ray

        self._ray: Any = ray
        self._problem = problem
        self._asked = problem.spec.model_dump_json(), problem.found
        self._workers = workers
        self._patience = patience
        self._slowest = 0.0  # s a candidate
        self._without = 0.0  # s without any worker
        self._why = ""
        self._hands: list[_Actor] = []
        self._started_here = not ray.is_initialized()
        if self._started_here:
            _start_ray(ray, workers, address)
        self._hire()

    def evaluate(self, batch: Array, meanwhile: Callable[[], None] = nothing) -> list[Outcome]:
        """Raises WorkerError where there was no worker for too long."""
        shares = Shares(self._problem, len(batch), max(self._workers, -(-len(batch) // SHARED)))
        self._hand_out(shares, batch)
        meanwhile()
        while shares.outcomes is None:
            self._watch(shares)
            self._hand_out(shares, batch)
        return shares.outcomes

    def _hire(self) -> None:
        actor: Any = self._ray.remote(num_cpus=1)(_Worker)
        while len(self._hands) < self._workers:
            hired = actor.remote(*self._asked)
            self._hands.append(_Actor(hired, hired.place.remote()))

    def _hand_out(self, shares: Shares, batch: Array) -> None:
        for hand in self._hands:
            if hand.at is None and (share := shares.take()) is not None:
                hand.share, hand.watched = share, 0.0
                hand.at = hand.actor.evaluate.remote(batch[list(share.candidates)])

    def _watch(self, shares: Shares) -> None:
        """Waits until a worker has something to say, but not for long, and takes in all that is said."""
        before = time.monotonic()
        speaking = {hand.at: hand for hand in self._hands if hand.at is not None}
        self._ray.wait(list(speaking), timeout=TICK)
        said, _ = self._ray.wait(list(speaking), num_returns=len(speaking), timeout=0.0)
        # A driver that was stopped itself has not watched, and must not blame its workers.
        watched = min(time.monotonic() - before, 2.0 * TICK)
        for call in said:
            self._listen(speaking[call], shares)
        for hand in [hand for hand in self._hands if hand.share is not None]:
            hand.watched += watched
            if hand.watched > self._longest(hand):
                self._end(hand)
                self._lose(hand, shares, f"it took its worker longer than {self._longest(hand):.0f} s")
        self._wait_for_any(watched)
        if not said:
            self._hire()  # not more often, or a worker that cannot start would be started all the time

    def _longest(self, hand: _Actor) -> float:
        size = len(hand.share.candidates) if hand.share is not None else 0
        return max(self._patience, SLOWER * self._slowest * size)

    def _listen(self, hand: _Actor, shares: Shares) -> None:
        errors = self._ray.exceptions
        try:
            answer = self._ray.get(hand.at)
        except errors.RayTaskError as problem:  # an error in Python is the same wherever it is run
            if isinstance(problem.cause, MetaidError):
                raise problem.cause from None
            raise
        except errors.RayError as problem:
            self._lose(hand, shares, "it ended its worker's process", problem)
            return
        if hand.share is None:
            hand.place = answer
        else:
            outcomes, seconds = answer
            shares.done(hand.share, outcomes)
            self._slowest = max(self._slowest, seconds)
        hand.at = hand.share = None

    def _lose(self, hand: _Actor, shares: Shares, reason: str, problem: Exception | None = None) -> None:
        self._hands.remove(hand)
        self._ray.kill(hand.actor)
        self._why = reason if problem is None else (str(problem).strip().splitlines() or [reason])[-1].strip()
        if hand.share is not None:
            log.warning("a Ray worker was lost: its candidates are evaluated again")
            shares.lose(hand.share, reason)
            self._hire()

    def _end(self, hand: _Actor) -> None:
        """Ends a process that does not answer: Ray only asks it to end, and would keep its place for it."""
        assert hand.place is not None, "only one that has started can have a share"
        node, process = hand.place
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        killer: Any = self._ray.remote(num_cpus=0, scheduling_strategy=NodeAffinitySchedulingStrategy(node, soft=False))
        killer(_kill).remote(process)

    def _wait_for_any(self, watched: float) -> None:
        before, self._without = self._without, self._without + watched
        if any(hand.place is not None for hand in self._hands):
            self._without = 0.0
        elif self._without > self._patience:
            why = f" ({self._why[:200]})" if self._why else ""
            raise WorkerError(f"no Ray worker for {self._patience:.0f} s{why}")
        elif before <= ANNOUNCED < self._without:
            log.warning("no Ray worker is there: waiting for one, %.0f s at most", self._patience)

    def __enter__(self) -> RayEvaluator:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for hand in self._hands:
            self._ray.kill(hand.actor)
        if self._started_here:
            self._ray.shutdown()


class _Worker:
    """What runs in a Ray actor."""

    def __init__(self, spec: str, found: Array | None) -> None:
        self._objective = Problem(StudySpec.model_validate_json(spec), found).make_objective()
        self._warm = False

    def place(self) -> tuple[str, int]:
        """Its node and its process."""
        import ray

        return ray.get_runtime_context().get_node_id(), os.getpid()

    def evaluate(self, batch: Array) -> tuple[list[Outcome], float]:
        """Outcomes, and the processor seconds that a candidate took; 0 at first, when loops are still compiled."""
        begun, warm, self._warm = time.process_time(), self._warm, True
        shared = self._objective.share(batch)
        self._objective.work_on(shared)
        seconds = (time.process_time() - begun) / len(batch) if warm else 0.0
        return self._objective.outcomes(shared), seconds


def _kill(process: int) -> None:
    os.kill(process, signal.SIGKILL)


def _start_ray(ray: Any, workers: int, address: str | None) -> None:
    quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
    if address is None:
        with ray_on_loopback():
            ray.init(address="local", num_cpus=workers, include_dashboard=False, **quiet)
        return
    try:
        ray.init(address=address, **quiet)
    except (ConnectionError, ValueError, RuntimeError) as problem:
        if isinstance(problem.__cause__, ray.exceptions.AuthenticationError):
            raise StudyError(f"the Ray cluster at {address} wants its token (RAY_AUTH_TOKEN, or {TOKEN})") from None
        raise StudyError(f"no Ray cluster at {address}: {' '.join(str(problem).split())[:200]}") from None
