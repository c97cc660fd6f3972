"""The motion after each push, in windows that grow from a short one to the whole horizon.

A measure makes one number of a trial. The windows keep what a simulated twin can be compared with, joint by joint and
push by push. Short windows are nearly linear in the unknown lumps, long ones determine them best.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array

WINDOWS, SHORTEST = 5, 1.0 / 32.0  # how many, and the first as a share of the horizon
QUANTITIES = 4  # of each joint and window, see `Windows.motion`


def window_ends(steps: int, count: int = WINDOWS, shortest: float = SHORTEST) -> tuple[int, ...]:
    """The steps at which `count` windows of a horizon of `steps` end: each as many times longer than the one before,
    from the `shortest`, a share of the horizon, to all of it.
    """
    shares = shortest ** np.linspace(1.0, 0.0, count)
    return tuple(sorted({max(int(np.ceil(steps * share)), 1) for share in shares}))


def even_ends(steps: int, count: int) -> tuple[int, ...]:
    """The steps at which `count` windows of a horizon of `steps` end, each equally long after the one before."""
    return tuple(sorted({-(-steps * (i + 1) // count) for i in range(count)}))


@dataclass(frozen=True, eq=False)
class Windows:
    """What an episode showed up to the end of each window; zero after a fall.

    Attributes:
        ends: the steps (nwindow) at which the windows end.
        seen: how many windows (npush) of each push ended before a fall.
        motion: per push and window (npush x nwindow x 4 x njoint) each joint's angle in rad and speed in rad/s at the
            window's end, and ∫ q̇² dt in rad²/s and ∫ (q̈ + k q)² dt in rad²/s³ up to there.
        half_periods: crossings of the upright up to there (npush x nwindow x njoint), as a Record counts them.
    """

    ends: NDArray[np.int64]
    seen: NDArray[np.int64]
    motion: Array
    half_periods: NDArray[np.int64]

    @property
    def angles(self) -> Array:
        """At the ends of the windows (npush x nwindow x njoint), in rad."""
        return self.motion[:, :, 0]

    @property
    def speeds(self) -> Array:
        """At the ends of the windows (npush x nwindow x njoint), in rad/s."""
        return self.motion[:, :, 1]

    @property
    def speed_energy(self) -> Array:
        """∫ q̇² dt up to the ends of the windows (npush x nwindow x njoint), in rad²/s."""
        return self.motion[:, :, 2]

    @property
    def acceleration_energy(self) -> Array:
        """∫ (q̈ + k q)² dt up to the ends of the windows (npush x nwindow x njoint), in rad²/s³."""
        return self.motion[:, :, 3]

    def first(self, pushes: int) -> Windows:
        """The same without what was seen after the first `pushes`."""
        seen, motion, half_periods = self.seen.copy(), self.motion.copy(), self.half_periods.copy()
        for output in (seen, motion, half_periods):
            output[pushes:] = 0
        return replace(self, seen=seen, motion=motion, half_periods=half_periods)

    def thinned(self, every: int) -> Windows:
        """The same of the first of `every` so many pushes."""
        rows = slice(None, None, every)
        return replace(self, seen=self.seen[rows], motion=self.motion[rows], half_periods=self.half_periods[rows])


def windows_before_fall(
    ends: NDArray[np.int64],
    motion: Array,
    half_periods: NDArray[np.int64],
    ran: NDArray[np.int64],
    fell: NDArray[np.bool_],
) -> Windows:
    """The windows that a loop has filled in, without those that a fall cut short.

    Args:
        ends: the steps (nwindow) at which windows end.
        motion: as `Windows` has it, with anything in the windows after a fall.
        half_periods: likewise.
        ran: the steps of each push (npush), up to that of the fall where it fell; 0 of one that was never begun.
        fell: which pushes ended in a fall (npush).
    """
    is_seen = ends <= (ran - fell)[:, None]
    if is_seen.all():
        return Windows(ends, is_seen.sum(axis=1), motion, half_periods)
    shown = np.where(is_seen[..., None, None], motion, 0.0)
    return Windows(ends, is_seen.sum(axis=1), shown, half_periods * is_seen[..., None])
