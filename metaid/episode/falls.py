"""When a link has fallen."""

from __future__ import annotations

import numpy as np

from metaid.models import Array


def has_fallen(angles: Array, speeds: Array, limit: float, fastest: float) -> bool:
    """Whether any link is past `limit` (rad) and faster than `fastest` (rad/s), or not finite: falling is not
    coasting.  Eq. 8.

    Absolute `angles` (nlink) and `speeds` (nlink). Written so that NaN counts as fallen.
    """
    inside = (np.abs(angles) <= limit) | (np.abs(speeds) <= fastest)
    return not bool(np.all(inside & np.isfinite(angles)))
