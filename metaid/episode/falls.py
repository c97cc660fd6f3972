"""When a link has fallen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models import Array

FALL_LIMIT = np.pi / 2  # rad

RICH_FALL_LIMIT = np.pi  # rad; a link that is pushed to 60° on purpose has not fallen at 90°

FALL_MARGIN = 1.5  # past the limit, a link this many times faster than any was right after the push has fallen

LARGEST_TURN = 1.0  # rad in a control step; beyond it nothing is controlled, nor simulated, any more


@dataclass(frozen=True)
class FallRule:
    """When a link has fallen.  Eq. 8.

    It is past the `limit`, in rad, and faster than `margin` times what any link was right after the push, for falling
    is not coasting; or it turns by more than a radian in a control step; or its state is not finite. With a `margin` of
    0 a link past the limit has fallen however slow it is.
    """

    limit: float = FALL_LIMIT
    margin: float = FALL_MARGIN

    @property
    def clauses(self) -> tuple[float, float, float]:
        """What the compiled loops need: the limit in rad, the margin, and the largest turn in a control step in rad."""
        return self.limit, self.margin, LARGEST_TURN

    def fastest(self, speeds: Array) -> float:
        """The speed, in rad/s, up to which a link past the limit coasts, from the absolute link `speeds` (nlink), in
        rad/s, right after a push.
        """
        return float(self.margin * np.abs(speeds).max())

    def has_fallen(self, angles: Array, speeds: Array, fastest: float, timestep: float) -> bool:
        """Whether any link has fallen.

        Args:
            angles: absolute (nlink), in rad.
            speeds: absolute (nlink), in rad/s.
            fastest: up to which speed a link coasts, in rad/s.
            timestep: of the control, in s.
        """
        coasts = (np.abs(speeds) <= fastest) & np.isfinite(angles)
        # Written so that NaN counts as fallen.
        stands = ((np.abs(angles) <= self.limit) | coasts) & (np.abs(speeds) * timestep <= LARGEST_TURN)
        return not bool(stands.all())


USUAL_FALLS = FallRule()
