"""The crews by the name of their engine."""

from __future__ import annotations

from metaid.crew import Crew, LocalCrew
from metaid.errors import StudyError, unknown
from metaid.problem import Problem
from metaid.ray_crew import PATIENCE, RayCrew

ENGINES = ("local", "ray")


def make_crew(
    problem: Problem, engine: str, workers: int, ray_address: str | None = None, patience: float | None = None
) -> Crew:
    """A crew by engine name; Ray's has `patience` (s) with its workers.  Raises StudyError, naming the allowed
    ones.
    """
    if engine not in ENGINES:
        raise StudyError(unknown("engine", engine, ENGINES))
    if ray_address is not None and engine != "ray":
        raise StudyError("a Ray address needs the engine 'ray'")
    if engine == "local":
        return LocalCrew(problem, workers)
    return RayCrew(problem, workers, ray_address, PATIENCE if patience is None else patience)
