"""What one trial showed of its motion, and the law that it was sent; and the same beside what a twin shows of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.episode import Windows
from metaid.models import Array, Lumps


@dataclass(frozen=True)
class WatchedTrial:
    """A trial on a plant without noise.

    Attributes:
        law: the candidate's lumps; `inertia` is used only where there is a `stiffness`.
        timestep: between two torques, in s.
        start_speeds: joint speeds (npush x njoint) right after each push, in rad/s.
        windows: what was seen.
        stiffness: k of the law, in 1/s²; 0 where the plant coasts at the truth.
    """

    law: Lumps
    timestep: float
    start_speeds: Array
    windows: Windows
    stiffness: float = 0.0

    @property
    def ends(self) -> NDArray[np.int64]:
        """The steps (nwindow) at which windows end."""
        return self.windows.ends

    def seen(self, windows: int) -> NDArray[np.bool_]:
        """Which of the first `windows` windows of each push were seen (npush x nwindow)."""
        return np.arange(min(windows, len(self.ends))) < self.windows.seen[:, None]

    def thinned(self, every: int) -> WatchedTrial:
        """The same with the first of `every` so many pushes."""
        if every == 1:
            return self
        return replace(self, start_speeds=self.start_speeds[::every].copy(), windows=self.windows.thinned(every))


class Joints(NamedTuple):
    """What the joints of a robot have that its parameters do not say.

    `viscous` in N m s, `dry` in N m and `spring` in N m/rad (njoint each): friction, and the stiffness of a spring that
    is at rest where the joint is straight. `offset` (njoint), in rad: what an encoder reads there. `tilt`, in rad: of
    the base, one angle in the plane of a chain, two of an arm about horizontal axes.
    """

    viscous: Array
    dry: Array
    spring: Array
    offset: Array
    tilt: Array


@dataclass(frozen=True)
class Replay:
    """A trial as the plant showed it, and as the twin at an estimate moves under the same law.

    Attributes:
        times: since the push (ntime), in s.
        seen: joint angles of the plant (npush x ntime x njoint), in rad, of slides in m; NaN where none was kept.
        simulated: of the twin (npush x ntime x njoint); NaN after what was seen of a push.
        noise: standard deviation of an angle that is seen (njoint).
        joints: their names (njoint).
    """

    times: Array
    seen: Array
    simulated: Array
    noise: Array
    joints: tuple[str, ...]
