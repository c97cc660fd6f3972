"""The twin of a planar chain, which moves in absolute angles of its links."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.trials import Further, Joints, ReadTrial, WatchedTrial
from metaid.estimation.twin.planar_motion import (
    PlanarBalance,
    PlanarDerivatives,
    PlanarSpace,
    planar_balance,
    planar_derivatives,
    planar_space,
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

    def under_law(self, trial: WatchedTrial) -> tuple[PlanarBalance, PlanarDerivatives]:
        own = planar_balance(trial.law, self.lumps, self.unknowns.gravity)
        return own, planar_derivatives(self.unknowns, self.lumps)

    def driven(
        self, trial: ReadTrial, joints: Joints | None, further: Further
    ) -> tuple[PlanarBalance, PlanarDerivatives]:
        rubs, gravity = further.joints is not None and bool(further.joints.dry.any()), self.unknowns.gravity
        own = planar_balance(None, self.lumps, gravity, joints=joints, is_continuous=trial.is_continuous, rubs=rubs)
        return own, planar_derivatives(self.unknowns, self.lumps, further)

    @property
    def space(self) -> tuple[NDArray[np.int64], PlanarSpace]:
        return planar_space(self.unknowns.njoint)
