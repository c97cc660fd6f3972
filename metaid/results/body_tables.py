"""What is known of individual parameters of the links: of a chain the set of all possible bodies with the lumps of an
estimate, of an arm the possible bodies that are closest to the nominal ones, and how far from these they may be.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from metaid.errors import StudyError
from metaid.estimation import ArmEstimate, Estimate
from metaid.frames import json_rows
from metaid.models import COARSEST, DEVIATIONS, Array, Chain, body_extents, known_lumps
from metaid.models.tree import body_quantities, known_bodies
from metaid.results.snapshot import Snapshot


def bodies_table(snapshot: Snapshot) -> pd.DataFrame:
    """One row a mass, centre of mass and inertia of a link of a study, and, where no length is assumed, a length:
    `name`, `unit`, `nominal`, `low` to `high` over all possible bodies whose lumps are within the ellipsoid of the
    estimate's 95 % intervals, `bounded`, `true` where the plant knows it. Where a parameter is not `bounded`, `high` is
    infinite.  Raises StudyError where the verdict is not that the estimate found lumps, or no body has such lumps.
    """
    verdict = snapshot.verdict
    if not verdict.has_result:
        raise StudyError(f"no bodies: the verdict is '{verdict.word}': {'; '.join(verdict.reasons)}")
    if snapshot.estimate is None or verdict.source != "estimate":
        raise StudyError("no bodies: the lumps are those of the best trial, without intervals (allowed: an estimate)")
    with threadpool_limits(1):
        columns_of: Any = _of_arm if snapshot.spec.is_arm else _of_chain
        columns = columns_of(snapshot.estimate.estimate, snapshot.estimate.covariance, snapshot.problem)
    if columns is None:
        raise StudyError("no bodies: no possible body has the lumps of the estimate: are the lengths right?")
    return pd.DataFrame(columns)


def _of_chain(estimate: Estimate, covariance: Array, problem: Any) -> dict[str, Any] | None:
    """The columns of the table of a chain, by its `estimate` with the `covariance` of its numbers; None where there is
    no such body.
    """
    nominal, truth = problem.nominal, problem.robot.truth
    is_given = problem.spec.study.estimate.lengths == "exact" or "coriolis" not in problem.robot.estimated_kinds
    length = nominal.length if is_given else None
    lumps = known_lumps(estimate.names, estimate.parameters, covariance, DEVIATIONS, length)
    extents = body_extents(lumps)
    if extents is None:
        return None

    def of(chain: Chain) -> Array:
        return np.concatenate([chain.mass, chain.com, chain.inertia, chain.length])[: len(lumps.names)]

    return {
        "name": lumps.names,
        "unit": lumps.units,
        "nominal": of(nominal),
        "low": extents[0],
        "high": extents[1],
        "bounded": np.isfinite(extents[1]),
        "true": np.full(len(lumps.names), np.nan) if truth is None else of(truth),
    }


def _of_arm(estimate: ArmEstimate, covariance: Array, problem: Any) -> dict[str, Any] | None:
    """The same of an arm."""
    bodies, truth = known_bodies(problem.robot.prior, estimate.values, covariance), problem.robot.truth
    if bodies is None:
        return None
    reach = DEVIATIONS * bodies.deviations
    return {
        "name": bodies.names,
        "unit": bodies.units,
        "nominal": body_quantities(problem.nominal),
        "identified": bodies.values,
        "sd": bodies.deviations,
        "low": bodies.values - reach,
        "high": bodies.values + reach,
        "bounded": np.ones(len(reach), dtype=np.bool_),
        "true": np.full(len(reach), np.nan) if truth is None else body_quantities(truth),
    }


def body_rows(snapshot: Snapshot) -> dict[str, Any]:
    """The same for a `summary`: `bodies`, None where there are none, and `why_no_bodies`."""
    try:
        frame = bodies_table(snapshot)
    except StudyError as why:
        return {"bodies": None, "why_no_bodies": str(why)}
    return {"bodies": json_rows(frame.replace({"high": {np.inf: np.nan}})), "why_no_bodies": None}


def describe_possible_bodies(rows: list[dict[str, Any]]) -> str:
    """What the ranges of all possible bodies in a `summary` mean, in a sentence or two."""
    known = [
        row["name"]
        for row in rows
        if row["bounded"] and row["high"] - row["low"] <= COARSEST * abs(row["high"] + row["low"])
    ]
    if "sd" in rows[0]:
        text = (
            "identified are the possible bodies closest to the nominal ones, and low to high is their 95 % interval to "
            "first order, in which what the trials leave open is as wrong as [estimate] says that it may be"
        )
    else:
        text = "low to high is over all possible bodies whose lumps are within the ellipsoid of the intervals"
    if any(row["name"] == "length_1" for row in rows):
        text += "; no length is assumed"
    return f"{text}; known to a tenth: {', '.join(known) or 'none'}"
