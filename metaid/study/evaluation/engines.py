"""Evaluators by the name of their engine: what evaluates the candidates of a generation, wherever that is done.

An outcome depends on its candidate and the number of its trial alone, so it does not matter which worker evaluates it.
"""

from __future__ import annotations

from metaid.errors import StudyError, unknown
from metaid.study.evaluation.ray_actors import WORKER_PATIENCE, RayEvaluator
from metaid.study.evaluation.threads import ThreadEvaluator
from metaid.study.problem import Problem

Evaluator = ThreadEvaluator | RayEvaluator  # its workers end when it is closed

ENGINES = ("local", "ray")


def make_evaluator(
    problem: Problem, engine: str, workers: int, ray_address: str | None = None, patience: float | None = None
) -> Evaluator:
    """An evaluator of a problem's candidates.

    Args:
        problem: whose candidates it evaluates.
        engine: "local" for threads of this process, "ray" for Ray actors.
        workers: how many threads or actors.
        ray_address: of a running Ray cluster; None starts Ray on this machine's loopback.
        patience: s without an answer after which a Ray actor is replaced; None for WORKER_PATIENCE.

    Raises:
        StudyError: for an unknown engine, an address without Ray, or a cluster that cannot be joined.
    """
    if engine not in ENGINES:
        raise StudyError(unknown("engine", engine, ENGINES))
    if ray_address is not None and engine != "ray":
        raise StudyError("a Ray address needs the engine 'ray'")
    if engine == "local":
        return ThreadEvaluator(problem, workers)
    return RayEvaluator(problem, workers, ray_address, WORKER_PATIENCE if patience is None else patience)
