"""The simulated twin of a robot, and the derivatives of what it shows by all that is unknown.

`twin_of(unknowns, point)` moves by a planar kernel where the unknowns are those of a chain, else by a spatial one.
`watch` shows windows of a trial on exact sensors, `drive` the readings of a noisy one, `lead` a filter through these.
"""

from metaid.estimation.log_unknowns import LogUnknowns
from metaid.estimation.twin.planar import PlanarTwin
from metaid.estimation.twin.shown import Filter, Shown
from metaid.estimation.twin.spatial import SpatialTwin
from metaid.estimation.twin.twin import Twin
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array


def twin_of(unknowns: Unknowns, point: Array) -> Twin:
    """The twin of a robot with these `unknowns` at a `point` (nunknown)."""
    return (PlanarTwin if isinstance(unknowns, LogUnknowns) else SpatialTwin)(unknowns, point)
