"""What evaluates a generation: threads on this machine, or Ray actors on this machine or on a cluster; and an objective
and a sampler for Optuna's own `optimize`.
"""

from metaid.study.evaluation.engines import Evaluator, make_evaluator
from metaid.study.evaluation.optuna_objective import NominalMetricSampler, OptunaObjective
from metaid.study.evaluation.ray_actors import RayEvaluator
from metaid.study.evaluation.threads import ThreadEvaluator
