"""What a study of an arm can determine, by its nominal arm, before any trial."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from metaid.errors import StudyError
from metaid.models import DEVIATIONS, Array
from metaid.models.tree import seen_by_bias
from metaid.plant import FaultSettings
from metaid.search import Searcher
from metaid.study.loops import QUIETEST_RIG
from metaid.study.spatial.problem import ArmProblem
from metaid.study.spec import ArmPlantSettings, TreeSettings

if TYPE_CHECKING:
    from metaid.compiled import Objective

OWN_NOISE = 1  # added to the study's seed: a rehearsal has other noise than the study


@dataclass(frozen=True)
class ArmIdentifiability:
    """Of each base parameter (nbase).

    Attributes:
        names: of them.
        units: of them.
        expressions: what they are made of.
        resolution: 1.96 standard deviations after one trial, in their units.
        beforehand: the same before any trial.
        seen_by_bias: whether coasts show it; others show on springs alone.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    expressions: tuple[str, ...]
    resolution: Array
    beforehand: Array
    seen_by_bias: NDArray[np.bool_]


def arm_identifiability(problem: ArmProblem) -> ArmIdentifiability:
    """What one trial of a study tells, were the arm the nominal one and sent its law.

    Raises StudyError where such a trial tells nothing.
    """
    alike, prior = _nominal_problem(problem), problem.prior
    experiment = alike.experiment()
    assert experiment is not None, "an estimate is enabled"
    with threadpool_limits(1):
        trial = experiment.trial(prior.values, alike.make_objective().evaluate(prior.values))
        estimate = None if trial is None else experiment.estimate([trial], thorough=False)
    if estimate is None:
        raise StudyError("under the law of the nominal arm its pushes show nothing")
    base = prior.base
    return ArmIdentifiability(
        names=base.names,
        units=base.units,
        expressions=base.expressions,
        resolution=DEVIATIONS * estimate.value_deviations,
        beforehand=DEVIATIONS * np.sqrt(np.diag(prior.covariance)),
        seen_by_bias=seen_by_bias(problem.nominal, base),
    )


def arm_rehearsal(problem: ArmProblem) -> tuple[Searcher, Objective]:
    """The searcher and the objective of a study if its nominal arm were the truth."""
    alike = _nominal_problem(problem, OWN_NOISE)
    return alike.make_searcher(), alike.make_objective()


def _nominal_problem(problem: ArmProblem, further: int = 0) -> ArmProblem:
    """The same study on the nominal arm, with an estimate; `further` is added to the seed of the noise."""
    spec = problem.spec
    nominal = TreeSettings.of(problem.nominal)
    if spec.simulated is not None:
        plant = spec.simulated.model_copy(update={"arm": nominal})
    else:
        noise = FaultSettings(angle_noise=QUIETEST_RIG)
        plant = ArmPlantSettings(arm=nominal, timestep=spec.plant.timestep, truth_known=False, faults=noise)
    settings = spec.study.estimate.model_copy(update={"enabled": True})
    study = spec.study.model_copy(update={"estimate": settings, "seed": spec.study.seed + further})
    return ArmProblem(spec.model_copy(update={"plant": plant, "study": study, "pushed": None}))
