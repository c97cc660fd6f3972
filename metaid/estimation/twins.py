"""Which twin a robot has."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from metaid.estimation.planar_twin import PlanarTwin
from metaid.estimation.spatial_twin import SpatialTwin
from metaid.estimation.twin import Twin
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array

TWINS: dict[str, Callable[[Any, Array], Twin]] = {"planar": PlanarTwin, "spatial": SpatialTwin}


def twin_of(unknowns: Unknowns, point: Array) -> Twin:
    """The twin of a robot with these `unknowns` at a `point` (nunknown)."""
    return TWINS[unknowns.kernel](unknowns, point)
