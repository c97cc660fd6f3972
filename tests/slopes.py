"""Whether the derivatives of residuals are what the residuals change by."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pytest

from metaid.estimation import Residuals
from metaid.models import Array

STEP = 3e-6


class Compared(Protocol):
    """What is compared with a twin."""

    stages: int

    def residuals(self, unknowns: Array, stage: int, /) -> Residuals | None: ...


def assert_slopes(compared: Compared, point: Array, within: float = 1e-3) -> None:
    """By central differences at a `point`, for each unknown, to a share of the largest."""
    here = compared.residuals(point, compared.stages)
    assert here is not None
    for direction, own in zip(np.eye(len(point)), here.slopes.T, strict=True):
        ahead, behind = (compared.residuals(point + side * direction, compared.stages) for side in (STEP, -STEP))
        assert ahead is not None
        assert behind is not None
        slope = (ahead.values - behind.values) / (2.0 * STEP)
        assert own == pytest.approx(slope, rel=within, abs=within * float(np.abs(slope).max()))
