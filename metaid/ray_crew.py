"""Ray actors as a crew, on this machine or on a cluster."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from types import TracebackType
from typing import Any

from metaid.chain import Array
from metaid.crew import nothing
from metaid.errors import StudyError
from metaid.objective import Outcome
from metaid.problem import Problem, StudySpec


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

    def evaluate(self, batch: Array, meanwhile: Callable[[], None] = nothing) -> list[Outcome]:
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
        shared = self._objective.share(batch)
        self._objective.work_on(shared)
        return self._objective.outcomes(shared)


def _start_ray(ray: Any, workers: int, address: str | None) -> None:
    quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
    if address is None:
        ray.init(num_cpus=workers, include_dashboard=False, **quiet)
        return
    try:
        ray.init(address=address, **quiet)
    except (ConnectionError, ValueError, RuntimeError) as problem:
        raise StudyError(f"no Ray cluster at {address}: {' '.join(str(problem).split())[:200]}") from None
