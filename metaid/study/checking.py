"""What a study can determine, and how well, by its nominal model, before any trial."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from metaid.study.create import refuse_what_cannot_be_run
from metaid.study.forecast import OWN_NOISE, forecast, refuse_until
from metaid.study.identifiability import Identifiability, identifiability
from metaid.study.loading import problem_of
from metaid.study.parameters import Parameters
from metaid.study.problem import Problem
from metaid.study.spec import StudySpec

MARGIN = 10.0  # the noise of a reading over the error of the steps that such noise hides


def check(spec: StudySpec, until: float | None = None) -> dict[str, Any]:
    """To within what all pushes of a study tell each lump, or one trial each base parameter, and with `until` what it
    takes until all is known to that share: the JSON of `metaid study check`.  Raises StudyError where the study cannot
    be run, or not until then.
    """
    refuse_what_cannot_be_run(spec)
    if until is not None:
        refuse_until(spec, until)
    problem = problem_of(spec)
    found, precise = identifiability(problem), stepping(problem)
    shown: dict[str, Any] = {"study": spec.name, "measure": problem.measure.name}
    shown |= (
        {"lumps": _base_parameters(problem.robot.sought, found)}
        if spec.is_arm
        else {"lumps": _lumps(found), "undetermined": list(found.combinations)}
    )
    shown |= {} if until is None else {"until": forecast(problem, until).row}
    return shown | ({} if precise is None else {"twin": asdict(precise)})


def _lumps(found: Identifiability) -> list[dict[str, Any]]:
    """A row a lump; None where it cannot be found, or is not bounded."""
    numbers = found.resolution.tolist(), found.determined, found.low.tolist(), found.high.tolist()
    return [
        {
            "name": name,
            "resolution": resolution if math.isfinite(resolution) else None,
            "determined": determined,
            "low": low if math.isfinite(high) else None,
            "high": high if math.isfinite(high) else None,
        }
        for name, resolution, determined, low, high in zip(found.names, *numbers, strict=True)
    ]


def _base_parameters(sought: Parameters, found: Identifiability) -> list[dict[str, Any]]:
    """A row a base parameter, with the pushes that show it."""
    keys = "name", "nominal", "resolution", "determined", "shown_by", "unit", "expression"
    columns = sought.nominal.tolist(), found.resolution.tolist(), found.determined
    told = zip(found.names, *columns, found.shown_by or (), sought.units, sought.expressions or (), strict=True)
    return [dict(zip(keys, row, strict=True)) for row in told]


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
