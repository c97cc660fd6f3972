"""Where a push begins, and how hard it is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from metaid.errors import PlantError
from metaid.models import Array


@dataclass(frozen=True, eq=False)
class Start:
    """From where a push begins: the plant at rest at a `pose`, its joint angles (njoint), in rad, whose link tips are
    struck with horizontal `impulses` (njoint), in N s.
    """

    impulses: Array
    pose: Array

    @classmethod
    def upright(cls, impulses: Array) -> Start:
        """From the upright, with these `impulses` (njoint), in N s."""
        return cls(impulses, np.zeros(len(impulses)))

    def struck(self, noise: Array) -> Start:
        """The same where chance adds this `noise` (njoint) to the impulses, as shares of them."""
        return replace(self, impulses=self.impulses * (1.0 + noise))

    @property
    def asked(self) -> dict[str, list[float]]:
        """What a rig is asked for.  Raises PlantError where it is to begin elsewhere than upright: the protocol has no
        word for that.
        """
        if self.pose.any():
            raise PlantError(
                f"a push is to begin at joint angles {self.pose.tolist()} rad "
                "(allowed: 0 rad for every joint; a rig is pushed from the upright)"
            )
        return {"impulses": self.impulses.tolist()}


@dataclass(frozen=True, eq=False)
class ArmStart:
    """From where a push of an arm begins: joint coordinates `pose` (njoint), in rad or m, and joint `speeds` (njoint),
    in rad/s or m/s. A position controller brought it there.
    """

    pose: Array
    speeds: Array

    @property
    def asked(self) -> dict[str, list[float]]:
        """What a rig is asked for."""
        return {"pose": self.pose.tolist(), "speeds": self.speeds.tolist()}

    def struck(self, noise: Array) -> ArmStart:
        """The same where chance adds this `noise` (njoint) to the speeds, as shares of them."""
        return replace(self, speeds=self.speeds * (1.0 + noise))
