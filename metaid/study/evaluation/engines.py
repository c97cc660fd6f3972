"""The crews by the name of their engine."""

from __future__ import annotations

from metaid.errors import StudyError, unknown
from metaid.study.evaluation.ray_actors import PATIENCE, RayEvaluator
from metaid.study.evaluation.threads import Evaluator, ThreadEvaluator
from metaid.study.problem import Problem

ENGINES = ("local", "ray")


def make_evaluator(
    problem: Problem, engine: str, workers: int, ray_address: str | None = None, patience: float | None = None
) -> Evaluator:
    """A crew by engine name; Ray's has `patience` (s) with its workers.  Raises StudyError, naming the allowed
    ones.
    """
    if engine not in ENGINES:
        raise StudyError(unknown("engine", engine, ENGINES))
    if ray_address is not None and engine != "ray":
        raise StudyError("a Ray address needs the engine 'ray'")
    if engine == "local":
        return ThreadEvaluator(problem, workers)
    return RayEvaluator(problem, workers, ray_address, PATIENCE if patience is None else patience)
