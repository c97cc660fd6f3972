"""What a perturb-and-count episode is.

An episode is a number of pushes. For each, the plant is brought to where the push begins, pushed or let go, and for a
fixed number of steps sent nothing but the torque that a candidate's law says would cancel gravity, Coriolis forces and
friction, or have it swing as on springs. What else differs between a planar chain and an arm is its `Kind`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from metaid.episode.falls import RICH_RUNAWAY, FallRule
from metaid.episode.planar import PLANAR, Planar
from metaid.episode.plausible import Calibration
from metaid.episode.pushed import Pushed
from metaid.episode.spatial import KnownStarts, Spatial
from metaid.episode.windows import window_ends
from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant import ArmStart

Kind = Planar | Spatial  # how pushes begin and end, what law they follow, and what they show


@dataclass(frozen=True, eq=False)
class Episode(Pushed):
    """What is done to a plant with every candidate.

    Attributes:
        calibration: what was measured at a rig; readings that cannot be true end the episode.
        kind: of robot.
    """

    calibration: Calibration | KnownStarts | None = None
    kind: Kind = PLANAR

    def __post_init__(self) -> None:
        super().__post_init__()
        self.kind.check_pushes(self.pushes)

    @property
    def starts(self) -> list[Any]:
        """From where each push begins (npush)."""
        return [self.kind.start(pose, push) for pose, push in self.states]

    @property
    def begins(self) -> Array:
        """Joint angles and speeds with which pushes of an arm begin (npush x 2 x njoint), as far as is known."""
        return self.states if self.calibration is None else self.calibration.begun

    def shortened(self, steps: int) -> Episode:
        """A push of each stiffness, for at most that many `steps`, with windows."""
        steps = min(steps, self.steps)
        first = sorted(np.unique(self.springs, return_index=True)[1].tolist())
        return replace(
            self,
            pushes=self.pushes[first],
            poses=None if self.poses is None else self.poses[first],
            stiffness=self.springs[first],
            calibration=None,
            steps=steps,
            readings_steps=min(self.readings_steps, steps),
            window_ends=window_ends(steps),
        )


def arm_episode(nominal: Tree, starts: Sequence[ArmStart], stiffness: Array, steps: int, **more: Any) -> Episode:
    """What is done to an arm.

    Args:
        nominal: whose mass matrix weighs the motion, and whose joint ranges bound it.
        starts: from where each push begins (npush).
        stiffness: of each push (npush), in 1/s².
        steps: after each push.
        more: what else an `Episode` has.
    """
    poses, speeds = (np.array([getattr(start, name) for start in starts]) for name in ("pose", "speeds"))
    settings = {"fall_rule": FallRule(runaway=RICH_RUNAWAY), "stiffness": stiffness, "poses": poses, **more}
    return Episode(speeds, steps, kind=Spatial(nominal), **settings)
