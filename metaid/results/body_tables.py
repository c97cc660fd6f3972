"""What is known of individual parameters: the set of all possible bodies with the lumps of an estimate."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from metaid.errors import StudyError
from metaid.models import DEVIATIONS, Array, Chain, body_extents, known_lumps
from metaid.plant import MujocoPlant
from metaid.results.lump_tables import without_nan
from metaid.results.verdict import Verdict
from metaid.study import COARSEST, Problem
from metaid.study.estimates import ChainFound


def bodies_table(problem: Problem, found: ChainFound | None, verdict: Verdict) -> pd.DataFrame:
    """One row a parameter of the links: what `metaid.bodies` gives.

    Args:
        problem: of a study.
        found: its estimate.
        verdict: on the study.

    Raises:
        StudyError: the verdict is not that the estimate found lumps, or no body has such lumps.
    """
    if not verdict.has_result:
        raise StudyError(f"no bodies: the verdict is '{verdict.word}': {'; '.join(verdict.reasons)}")
    if found is None or verdict.source != "estimate":
        raise StudyError("no bodies: the lumps are those of the best trial, without intervals (allowed: an estimate)")
    estimate, nominal = found.estimate, problem.nominal
    is_given = problem.spec.study.estimate.lengths == "exact" or "coriolis" not in problem.estimated_kinds
    length = nominal.length if is_given else None
    lumps = known_lumps(estimate.names, estimate.parameters, found.covariance, DEVIATIONS, length)
    with threadpool_limits(1):
        extents = body_extents(lumps)
    if extents is None:
        raise StudyError("no bodies: no possible body has the lumps of the estimate: are the lengths right?")

    def of(chain: Chain) -> Array:
        return np.concatenate([chain.mass, chain.com, chain.inertia, chain.length])[: len(lumps.names)]

    plant, true = problem.open_plant(), np.full(len(lumps.names), np.nan)
    if isinstance(plant, MujocoPlant) and plant.settings.truth_known:
        true = of(plant.chain)
    columns = {
        "name": lumps.names,
        "unit": lumps.units,
        "nominal": of(nominal),
        "low": extents[0],
        "high": extents[1],
        "bounded": np.isfinite(extents[1]),
        "true": true,
    }
    return pd.DataFrame(columns)


def body_rows(problem: Problem, found: ChainFound | None, verdict: Verdict) -> dict[str, Any]:
    """The same for a `summary`: `bodies`, None where there are none, and `why_no_bodies`."""
    try:
        frame = bodies_table(problem, found, verdict)
    except StudyError as why:
        return {"bodies": None, "why_no_bodies": str(why)}
    rows = frame.replace({"high": {np.inf: np.nan}}).to_dict("records")
    return {"bodies": [without_nan(row) for row in rows], "why_no_bodies": None}


def describe_possible_bodies(rows: list[dict[str, Any]]) -> str:
    """What the ranges of all possible bodies in a `summary` mean, in a sentence or two."""
    known = [
        row["name"]
        for row in rows
        if row["bounded"] and row["high"] - row["low"] <= COARSEST * (row["high"] + row["low"])
    ]
    text = "low to high is over all possible bodies whose lumps are within the ellipsoid of the intervals"
    if any(row["name"] == "length_1" for row in rows):
        text += "; no length is assumed"
    return f"{text}; known to a tenth: {', '.join(known) or 'none'}"
