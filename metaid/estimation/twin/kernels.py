"""What a twin does by its kernel, planar or spatial, chosen by the type of its `balance` when a loop is compiled.

A kernel works in coordinates of its own (see `workspace`). It says how the robot accelerates, M α = F, and what that
changes by: G = ∂(F - M α)/∂φ with α held, H = ∂F/∂ω, and Y_p = ∂(F - M α)/∂p of each unknown p of the robot.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from metaid.compiled import class_of
from metaid.estimation.twin import planar_motion, planar_slopes, spatial_motion, spatial_slopes
from metaid.estimation.twin.planar_motion import PlanarBalance


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


@overload(accelerate, inline="always")
def _accelerate(balance, work):  # type: ignore[no-untyped-def]
    if class_of(balance) is PlanarBalance:
        return lambda balance, work: planar_motion.accelerate(balance, work)
    return lambda balance, work: spatial_motion.accelerate(balance, work)


@overload(linearise, inline="always")
def _linearise(balance, work):  # type: ignore[no-untyped-def]
    if class_of(balance) is PlanarBalance:
        return lambda balance, work: planar_slopes.linearise(balance, work)
    return lambda balance, work: spatial_slopes.linearise(balance, work)


@overload(force_by_unknowns, inline="always")
def _force_by_unknowns(balance, derivatives, work):  # type: ignore[no-untyped-def]
    if class_of(balance) is PlanarBalance:
        return lambda balance, derivatives, work: planar_slopes.force_by_unknowns(derivatives, work)
    return lambda balance, derivatives, work: spatial_slopes.force_by_unknowns(balance, derivatives, work)


@overload(turn_base, inline="always")
def _turn_base(balance, beside, work):  # type: ignore[no-untyped-def]
    if class_of(balance) is PlanarBalance:
        return lambda balance, beside, work: None
    return lambda balance, beside, work: spatial_slopes.turn_base(balance, beside, work)
