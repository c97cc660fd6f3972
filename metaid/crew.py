"""Who evaluates a generation: threads over the compiled loop, or Ray actors on this machine or a cluster.

Each worker has an objective, and so a plant, of its own. An outcome depends on its candidate alone, so it does not
matter who evaluates it.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Any, Protocol

import numpy as np

from metaid.chain import Array
from metaid.errors import StudyError, unknown
from metaid.objective import Objective, Outcome
from metaid.problem import Problem, StudySpec

ENGINES = ("local", "ray")


def _nothing() -> None:
    return


class Crew(Protocol):
    """A context manager that evaluates batches."""

    def evaluate(self, batch: Array, meanwhile: Callable[[], None] = _nothing) -> list[Outcome]:
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

    def evaluate(self, batch: Array, meanwhile: Callable[[], None] = _nothing) -> list[Outcome]:
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


class RayCrew:
    """Ray actors, each with an objective; a batch is sent in one call per actor."""

    def __init__(self, spec: StudySpec, workers: int, address: str | None) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
        import ray

        self._ray: Any = ray
        self._started_here = not ray.is_initialized()
        if self._started_here:
            _start_ray(ray, workers, address)
        actor: Any = ray.remote(num_cpus=1)(_Worker)
        self._actors = [actor.remote(spec.model_dump_json()) for _ in range(workers)]

    def evaluate(self, batch: Array, meanwhile: Callable[[], None] = _nothing) -> list[Outcome]:
        shares = [range(first, len(batch), len(self._actors)) for first in range(len(self._actors))]
        calls = [actor.evaluate.remote(batch[list(share)]) for actor, share in zip(self._actors, shares, strict=True)]
        meanwhile()
        answers = self._ray.get(calls)
        by_candidate = dict(zip(itertools.chain(*shares), itertools.chain(*answers), strict=True))
        return [by_candidate[i] for i in range(len(batch))]

    def __enter__(self) -> RayCrew:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for actor in self._actors:
            self._ray.kill(actor)
        if self._started_here:
            self._ray.shutdown()


class _Worker:
    """What runs in a Ray actor."""

    def __init__(self, spec: str) -> None:
        self._objective = Problem(StudySpec.model_validate_json(spec)).make_objective()

    def evaluate(self, batch: Array) -> list[Outcome]:
        return [self._objective.evaluate(np.array(factors)) for factors in batch]


def _start_ray(ray: Any, workers: int, address: str | None) -> None:
    quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
    if address is None:
        ray.init(num_cpus=workers, include_dashboard=False, **quiet)
        return
    try:
        ray.init(address=address, **quiet)
    except (ConnectionError, ValueError, RuntimeError) as problem:
        raise StudyError(f"no Ray cluster at {address}: {' '.join(str(problem).split())[:200]}") from None


def make_crew(problem: Problem, engine: str, workers: int, ray_address: str | None = None) -> Crew:
    """A crew by engine name.  Raises StudyError, naming the allowed ones."""
    if engine not in ENGINES:
        raise StudyError(unknown("engine", engine, ENGINES))
    if ray_address is not None and engine != "ray":
        raise StudyError("a Ray address needs the engine 'ray'")
    return LocalCrew(problem, workers) if engine == "local" else RayCrew(problem.spec, workers, ray_address)
