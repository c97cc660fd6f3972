"""What evaluates a generation: threads on this machine, or Ray actors on this machine or on a cluster."""

from metaid.study.evaluation.engines import make_evaluator
from metaid.study.evaluation.evaluator import Evaluator
from metaid.study.evaluation.ray_actors import RayEvaluator
from metaid.study.evaluation.threads import ThreadEvaluator

__all__ = [
    "Evaluator",
    "RayEvaluator",
    "ThreadEvaluator",
    "make_evaluator",
]
