"""What sensors and hosts do to readings, repaired where the readings themselves say how."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from metaid.recorded.reading.readings import Readings


def repaired(readings: Readings, slides: NDArray[np.bool_]) -> Readings:
    """The same, repaired; each repair is said.

    Args:
        readings: a log, in the order of time, without holes.
        slides: which joints (njoint) are slides.
    """
    return readings
