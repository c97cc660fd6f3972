"""The twin of a planar chain, which moves in absolute angles of its links."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.trials import NOTHING_FURTHER, Further, Joints, ReadTrial, WatchedTrial
from metaid.estimation.twin.planar_motion import (
    PlanarBalance,
    PlanarDerivatives,
    PlanarSpace,
    planar_balance,
    planar_derivatives,
)
from metaid.estimation.twin.twin import Twin
from metaid.models import Array, Lumps


class PlanarTwin(Twin):
    """A chain whose unknowns are `LogUnknowns`."""

    @cached_property
    def lumps(self) -> Lumps:
        """Of the chain."""
        lumps: Lumps = self.unknowns.lumps(self.point)
        return lumps

    @property
    def links(self) -> Array:
        return np.tril(np.ones((self.unknowns.njoint, self.unknowns.njoint)))

    def moving(
        self, trial: WatchedTrial | ReadTrial, joints: Joints | None = None, further: Further = NOTHING_FURTHER
    ) -> tuple[PlanarBalance, PlanarDerivatives]:
        rubs = further.joints is not None and bool(further.joints.dry.any())
        balance = planar_balance(trial.law, self.lumps, self.unknowns.gravity, joints, trial.is_continuous, rubs)
        return balance, planar_derivatives(self.unknowns, self.lumps, further)

    @property
    def space(self) -> tuple[NDArray[np.int64], PlanarSpace]:
        n = self.unknowns.njoint
        return np.arange(-1, n - 1), PlanarSpace(np.zeros(n), np.zeros(n), np.zeros((n, n)))
