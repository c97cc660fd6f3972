"""An estimate that no plant can have, brought as near as one comes to it that a plant can."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from metaid.estimation.descent import covariance_at, place_at
from metaid.estimation.estimate import Found
from metaid.estimation.faults import found_faults
from metaid.estimation.noisy.held_out import not_led
from metaid.estimation.noisy.innovations import compared_at
from metaid.estimation.noisy.readings import Readings


def as_possible(readings: Readings, estimate: Found) -> Found:
    """An `estimate` of some `readings` with the unknowns that a plant can have and that cost least (Eq. 69); faults and
    starts follow them. Where a plant can have it, or the twin cannot follow there, it is as it was.
    """
    nearest = readings.unknowns.nearest(estimate.unknowns, estimate.covariance * estimate.widening**2)
    if nearest is None:
        return estimate
    compared, count = compared_at(readings, estimate), len(nearest)
    place = None if compared is None else place_at(compared, estimate.point, compared.stages)
    if compared is None or place is None:
        return estimate
    covariance = covariance_at(place, compared.spreads)
    step = covariance[:, :count] @ np.linalg.solve(covariance[:count, :count], nearest - estimate.unknowns)
    following = place.residuals.following @ np.append(1.0, step)
    moved = place_at(compared, estimate.point + np.concatenate([step, following]), compared.stages)
    if moved is None:
        return estimate
    found = replace(
        estimate,
        unknowns=nearest,
        cost=moved.cost,
        misfit=moved.residuals.misfit,
        residuals=compared.by_joint(moved.point),
        extras=moved.point[len(step) :],
        faults=found_faults(compared.faults, moved.point, covariance),
    )
    return found if estimate.led_misfit is None else not_led(readings, found, moved.point)
