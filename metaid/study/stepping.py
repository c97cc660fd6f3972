"""How precise the steps of the twin of a rig are, by the nominal model, before any trial."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.study.forecast import OWN_NOISE
from metaid.study.problem import Problem

MARGIN = 10.0  # the noise of a reading over the error of the steps that such noise hides


@dataclass(frozen=True)
class Stepping:
    """How far the angles of the twin move where its steps are half as long, at most of all joints: `error` as a share
    of the noise of a reading. `timestep` of the twin, in s.
    """

    timestep: float
    error: float

    @property
    def is_precise(self) -> bool:
        return self.error * MARGIN <= 1.0


def stepping(problem: Problem) -> Stepping | None:
    """By the first trial of the study, on the nominal model in the plant's place. None of a simulated plant, whose own
    steps the twin takes, and where nothing comes of the trial.
    """
    experiment = problem.experiment()
    loop = None if experiment is None else experiment.loop
    if experiment is None or loop is None or not loop.is_continuous:
        return None
    rehearsed, objective = problem.rehearsal(OWN_NOISE)
    factors = problem.make_searcher(lambda: rehearsed).ask()[0]
    moved = experiment.step_error(factors, objective.evaluate(factors, 0))
    return None if moved is None else Stepping(loop.timestep, float(np.max(moved / loop.noise)))
