"""What a twin does by its kernel, planar or spatial, chosen by the type of its `balance` when a loop is compiled.

A kernel works in coordinates of its own (see `workspace`). It says how the robot accelerates, M α = F, and what that
changes by: G = ∂(F - M α)/∂φ with α held, H = ∂F/∂ω, and Y_p = ∂(F - M α)/∂p of each unknown p of the robot.
"""

from __future__ import annotations

from typing import Any

from metaid.compiled import choose
from metaid.estimation.twin import planar_motion, planar_slopes, spatial_motion, spatial_slopes
from metaid.estimation.twin.planar_motion import PlanarBalance
from metaid.estimation.twin.spatial_motion import SpatialBalance


def accelerate(balance: Any, work: Any) -> Any:
    """Fills in α and the factors of M, by the `balance` that the motion follows from and the state; whether M is
    positive definite, as that of any robot is.
    """
    raise NotImplementedError


def linearise(balance: Any, work: Any) -> Any:
    """Fills `solved` (njoint x 3 njoint) with M⁻¹ [1 G H]."""
    raise NotImplementedError


def force_by_unknowns(balance: Any, derivatives: Any, work: Any) -> Any:
    """Fills `changed` (njoint x nunknown) with M⁻¹ Y."""
    raise NotImplementedError


def turn_base(balance: Any, beside: Any, work: Any) -> Any:
    """Adds to `twist` what it does to turn the base about axes of its own."""
    raise NotImplementedError


choose(accelerate, {PlanarBalance: planar_motion.accelerate, SpatialBalance: spatial_motion.accelerate})
choose(linearise, {PlanarBalance: planar_slopes.linearise, SpatialBalance: spatial_slopes.linearise})
choose(
    force_by_unknowns,
    {PlanarBalance: planar_slopes.force_by_unknowns, SpatialBalance: spatial_slopes.force_by_unknowns},
)
choose(turn_base, {PlanarBalance: planar_slopes.turn_base, SpatialBalance: spatial_slopes.turn_base})
