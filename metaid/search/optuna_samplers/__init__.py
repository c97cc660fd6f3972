"""Optuna's samplers: as searchers of a study, and in a study's coordinates wherever Optuna runs."""

from metaid.search.optuna_samplers.metric import MetricSampler, candidate_space, tpe_for_metric
from metaid.search.optuna_samplers.searcher import MetricSearcher, OptunaSampler
