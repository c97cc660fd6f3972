"""Ray actors as workers, on this machine or on a cluster.

Actors come and go: each is given work as soon as it has started. One that dies, or that does not answer in time, is
replaced, and the others evaluate its candidates (`shares`).
"""

from __future__ import annotations

import logging
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from metaid.episode import Outcome
from metaid.errors import MetaidError, StudyError, WorkerError
from metaid.models import Array
from metaid.study.evaluation.ray_private import ray_on_loopback
from metaid.study.evaluation.shares import MOST_SHARED, Share, Shares
from metaid.study.loading import problem_of
from metaid.study.problem import Problem
from metaid.study.spec import StudySpec

WORKER_PATIENCE = 120.0  # s without an answer after which a worker is replaced
SLOWDOWN_ALLOWED = 100.0  # times what the slowest candidate so far took: a worker may take as long, past its patience
POLL_INTERVAL = 1.0  # s for which answers are waited for at most before the time limits are checked
WARN_AFTER = 10.0  # s without any worker, after which a warning is logged: Ray needs some 5 to start one
LONGEST_SILENCE = 10.0  # s for which an answer from a cluster's address is waited for

TOKEN = Path.home() / ".ray" / "auth_token"

log = logging.getLogger("metaid")


@dataclass(eq=False)
class _Actor:
    """A Ray actor as the driver sees it.

    Attributes:
        handle: by which it is called.
        call: the call that it has not yet answered, at first for its location; None where it is idle.
        share: what it evaluates; None where it has no work.
        busy: s for which the driver has watched it at its share.
        location: its node and its process, once it has started.
    """

    handle: Any
    call: Any
    share: Share | None = None
    busy: float = 0.0
    location: tuple[str, int] | None = None


class RayEvaluator:
    """Ray actors, each with an objective, and so a plant, of its own; a share of a batch is sent in one call.

    An actor is replaced that takes longer for its share than `patience` (s), and than SLOWDOWN_ALLOWED times what the
    slowest candidates so far would have taken. A batch waits for `patience` at most while there is no actor at all.
    """

    def __init__(self, problem: Problem, workers: int, address: str | None, patience: float = WORKER_PATIENCE) -> None:
        """Starts Ray, unless it runs in this process already, and asks it for actors.

        Args:
            problem: whose candidates are evaluated.
            workers: how many actors, of one core each.
            address: of a running cluster; None starts Ray on this machine's loopback.
            patience: s without an answer.

        Raises:
            StudyError: where the cluster cannot be joined, or Ray cannot be kept to loopback.
        """
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
        with _token_of(address):
            import ray

            started = not ray.is_initialized()
            if started:
                _start_ray(ray, workers, address)
        self._ray: Any = ray
        self._started_ray = started
        self._problem = problem
        self._spec = problem.spec.model_dump_json()
        self._worker_count = workers
        self._patience = patience
        self._slowest_candidate = 0.0  # s
        self._without_worker = 0.0  # s
        self._last_error = ""  # of an actor that was lost
        self._actors: list[_Actor] = []
        self._start_missing_actors()

    def evaluate(self, batch: Array, first: int = 0, while_waiting: Callable[[], None] = lambda: None) -> list[Outcome]:
        """As `ThreadEvaluator` does.  Raises WorkerError where there was no worker for too long."""
        shares = Shares(self._problem, len(batch), max(self._worker_count, -(-len(batch) // MOST_SHARED)))
        self._assign(shares, batch, first)
        while_waiting()
        while shares.outcomes is None:
            self._wait_for_answers(shares)
            self._assign(shares, batch, first)
        return shares.outcomes

    def _start_missing_actors(self) -> None:
        remote_class: Any = self._ray.remote(num_cpus=1)(_Worker)
        while len(self._actors) < self._worker_count:
            handle = remote_class.remote(self._spec)
            self._actors.append(_Actor(handle, call=handle.location.remote()))

    def _assign(self, shares: Shares, batch: Array, first: int) -> None:
        """Gives every idle actor a share of a `batch`, as long as there are any; `first` is as in `evaluate`."""
        for actor in self._actors:
            if actor.call is None and (share := shares.take()) is not None:
                actor.share, actor.busy = share, 0.0
                trials = [first + candidate for candidate in share.candidates]
                actor.call = actor.handle.evaluate.remote(batch[list(share.candidates)], trials)

    def _wait_for_answers(self, shares: Shares) -> None:
        """Waits for an answer, but not for long; takes in all that have come, and replaces actors that are too slow."""
        begun = time.monotonic()
        by_call = {actor.call: actor for actor in self._actors if actor.call is not None}
        self._ray.wait(list(by_call), timeout=POLL_INTERVAL)
        answered, _ = self._ray.wait(list(by_call), num_returns=len(by_call), timeout=0.0)
        # A driver that was itself stopped for a while did not watch its actors, and must not count that time.
        elapsed = min(time.monotonic() - begun, 2.0 * POLL_INTERVAL)
        for call in answered:
            self._receive(by_call[call], shares)
        for actor in [actor for actor in self._actors if actor.share is not None]:
            actor.busy += elapsed
            if actor.busy > self._time_limit(actor):
                self._kill_process(actor)
                self._remove(actor, shares, f"no answer from its worker for {self._time_limit(actor):.0f} s")
        self._count_time_without_worker(elapsed)
        if not answered:
            # Not more often: an actor that cannot start would be started all the time.
            self._start_missing_actors()

    def _time_limit(self, actor: _Actor) -> float:
        """How long an actor may take for its share, in s."""
        candidates = len(actor.share.candidates) if actor.share is not None else 0
        return max(self._patience, SLOWDOWN_ALLOWED * self._slowest_candidate * candidates)

    def _receive(self, actor: _Actor, shares: Shares) -> None:
        """Takes in an actor's answer.  Raises what a candidate raises wherever it is evaluated."""
        errors = self._ray.exceptions
        try:
            answer = self._ray.get(actor.call)
        except errors.RayTaskError as problem:
            if isinstance(problem.cause, MetaidError):
                raise problem.cause from None
            raise
        except errors.RayError as problem:
            self._remove(actor, shares, "its worker's process ended", problem)
            return
        if actor.share is None:
            actor.location = answer
        else:
            outcomes, seconds = answer
            shares.finish(actor.share, outcomes)
            self._slowest_candidate = max(self._slowest_candidate, seconds)
        actor.call = actor.share = None

    def _remove(self, actor: _Actor, shares: Shares, reason: str, problem: Exception | None = None) -> None:
        """Gives an actor up.

        Args:
            actor: that is lost.
            shares: where its share goes back to.
            reason: why its candidates were not evaluated, for the user.
            problem: what Ray said of it, if anything.
        """
        self._actors.remove(actor)
        self._ray.kill(actor.handle)
        self._last_error = reason if problem is None else (str(problem).strip().splitlines() or [reason])[-1].strip()
        if actor.share is not None:
            log.warning("a Ray worker was lost: its candidates are evaluated again")
            shares.lose(actor.share, reason)
            self._start_missing_actors()

    def _kill_process(self, actor: _Actor) -> None:
        """Kills a process that does not answer: Ray only asks it to end, and would keep its place for it."""
        assert actor.location is not None, "only an actor that has started can have a share"
        node, process = actor.location
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        on_node: Any = self._ray.remote(
            num_cpus=0, scheduling_strategy=NodeAffinitySchedulingStrategy(node, soft=False)
        )
        on_node(_kill).remote(process)

    def _count_time_without_worker(self, elapsed: float) -> None:
        """Raises WorkerError where no actor has been there for longer than the patience."""
        before, self._without_worker = self._without_worker, self._without_worker + elapsed
        if any(actor.location is not None for actor in self._actors):
            self._without_worker = 0.0
        elif self._without_worker > self._patience:
            cause = f" ({self._last_error[:200]})" if self._last_error else ""
            raise WorkerError(f"no Ray worker for {self._patience:.0f} s{cause}")
        elif before <= WARN_AFTER < self._without_worker:
            log.warning("no Ray worker yet: waiting for one, %.0f s at most", self._patience)

    def close(self) -> None:
        """Ends the workers."""
        for actor in self._actors:
            self._ray.kill(actor.handle)
        if self._started_ray:
            self._ray.shutdown()


class _Worker:
    """What runs in a Ray actor."""

    def __init__(self, spec: str) -> None:
        self._objective = problem_of(StudySpec.model_validate_json(spec)).make_objective()
        self._is_compiled = False

    def location(self) -> tuple[str, int]:
        """Its node and its process."""
        import ray

        return ray.get_runtime_context().get_node_id(), os.getpid()

    def evaluate(self, batch: Array, trials: list[int]) -> tuple[list[Outcome], float]:
        """Outcomes of a `batch` (ncandidate x nsearched) of the `trials` with these numbers (ncandidate), and the
        processor time that a candidate took, in s; 0 of the first batch, which compiles loops.
        """
        begun, was_compiled, self._is_compiled = time.process_time(), self._is_compiled, True
        shared = self._objective.share(batch, trials)
        self._objective.work_on(shared)
        seconds = (time.process_time() - begun) / len(batch) if was_compiled else 0.0
        return self._objective.outcomes(shared), seconds


def _kill(process: int) -> None:
    os.kill(process, signal.SIGKILL)


def _refuse_silence(address: str) -> None:
    """Raises StudyError where nothing listens at a cluster's address: Ray itself would try for minutes."""
    host, _, port = address.rpartition("://")[2].rpartition(":")
    if not (host and port.isdecimal()):
        return  # a word such as "auto", which Ray knows
    try:
        socket.create_connection((host.strip("[]"), int(port)), LONGEST_SILENCE).close()
    except (OSError, OverflowError, UnicodeError) as problem:
        why = getattr(problem, "strerror", None) or str(problem)
        raise StudyError(f"no Ray cluster at {address}: nothing answers there ({why})") from None


@contextmanager
def _token_of(address: str | None) -> Iterator[None]:
    """Within it Ray joins the cluster of an `address` by its token, where there is one, as `ray start` does.

    Not longer: a Ray that is started on this machine afterwards would want a token of a process that had none before.
    """
    has_token = TOKEN.exists() or bool({"RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH"} & set(os.environ))
    if address is None or not has_token or "RAY_AUTH_MODE" in os.environ:
        yield
        return
    os.environ["RAY_AUTH_MODE"] = "token"
    try:
        yield
    finally:
        os.environ.pop("RAY_AUTH_MODE", None)


@contextmanager
def own_signals() -> Iterator[None]:
    """Ray puts a handler of its own in the place of the driver's for SIGTERM, which is put back."""
    before = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, before)


def _start_ray(ray: Any, workers: int, address: str | None) -> None:
    quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
    if address is None:
        with ray_on_loopback(), own_signals():
            ray.init(address="local", num_cpus=workers, include_dashboard=False, **quiet)
        return
    _refuse_silence(address)
    try:
        with own_signals():
            ray.init(address=address, **quiet)
    except (ConnectionError, ValueError, RuntimeError) as problem:
        if isinstance(problem.__cause__, ray.exceptions.AuthenticationError):
            raise StudyError(f"the Ray cluster at {address} wants its token (RAY_AUTH_TOKEN, or {TOKEN})") from None
        raise StudyError(f"no Ray cluster at {address}: {' '.join(str(problem).split())[:200]}") from None
