"""A sampler for `optuna.create_study` that lets another one work in the nominal model's metric."""

from __future__ import annotations

from pathlib import Path

from optuna.samplers import BaseSampler

from metaid.search import MetricSampler, tpe_for_metric
from metaid.study.evaluation.optuna_objective import OptunaObjective
from metaid.study.loading import load_study, problem_of
from metaid.study.spec import StudySpec


class NominalMetricSampler(MetricSampler):
    """Proposes factors for `metaid.objective(study)` in the coordinates of metaid's own samplers (Eq. 16).

    Args:
        study: a shipped name, the path of a study file, settings, or the objective itself.
        sampler: that works in the metric, as `TPESampler` or `CmaEsSampler`; default: multivariate TPE.
        seed: of the default sampler; another one has its own.

    Raises:
        StudyError: the study's pushes cannot tell all lumps apart, so that there is no metric.
    """

    def __init__(
        self,
        study: str | Path | StudySpec | OptunaObjective,
        sampler: BaseSampler | None = None,
        seed: int | None = None,
    ) -> None:
        if isinstance(study, OptunaObjective):
            study = study.spec
        problem = problem_of(load_study(study) if isinstance(study, str | Path) else study)
        super().__init__(problem.names, problem.metric, tpe_for_metric(seed) if sampler is None else sampler)
