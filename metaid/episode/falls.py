"""When a link has fallen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models import Array

FALL_LIMIT = np.pi / 2  # rad

RICH_FALL_LIMIT = np.pi  # rad; a link that is pushed to 60° on purpose has not fallen at 90°

FALL_MARGIN = 1.5  # past the limit, a link this many times faster than any was right after the push has fallen

RICH_RUNAWAY = 5.0  # times what any link was after a rich push: no candidate within a tenth of the truth gets there

LARGEST_TURN = 1.0  # rad in a control step; beyond it nothing is controlled, nor simulated, any more


@dataclass(frozen=True)
class FallRule:
    """When a link has fallen.  Eqs. 8 and 9.

    It is past the `limit`, in rad, and faster than `margin` times what any link was right after the push, for falling
    is not coasting; or it runs away, wherever it is: it is faster than `runaway` times what any link was right after
    the push, or it turns by more than a radian in a control step; or its state is not finite. With a `margin` of 0 a
    link past the limit has fallen however slow it is.
    """

    limit: float = FALL_LIMIT
    margin: float = FALL_MARGIN
    runaway: float = np.inf

    @property
    def clauses(self) -> tuple[float, float, float, float]:
        """What the compiled loops need: the limit in rad, the margin, the largest turn in a control step in rad, and
        the multiple at which a link runs away.
        """
        return self.limit, self.margin, LARGEST_TURN, self.runaway

    def allowed_speeds(self, speeds: Array) -> tuple[float, float]:
        """The speed up to which a link past the limit coasts, and that up to which it has not run away, both in rad/s,
        from the absolute link `speeds` (nlink), in rad/s, right after a push.
        """
        fastest = float(np.abs(speeds).max())
        return self.margin * fastest, self.runaway * fastest

    def has_fallen(self, angles: Array, speeds: Array, allowed: tuple[float, float], timestep: float) -> bool:
        """Whether any link has fallen.

        Args:
            angles: absolute (nlink), in rad.
            speeds: absolute (nlink), in rad/s.
            allowed: up to which speed a link coasts, and up to which it has not run away, in rad/s.
            timestep: of the control, in s.
        """
        coasting, anywhere = allowed
        turn = anywhere * timestep if anywhere * timestep < LARGEST_TURN else LARGEST_TURN
        coasts = (np.abs(speeds) <= coasting) & np.isfinite(angles)
        # Written so that NaN counts as fallen.
        stands = ((np.abs(angles) <= self.limit) | coasts) & (np.abs(speeds) * timestep <= turn)
        return not bool(stands.all())


USUAL_FALLS = FallRule()
