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

from metaid.episode.falls import RICH_RUNAWAY, USUAL_FALLS, FallRule
from metaid.episode.kind import Calibrated, Kind
from metaid.episode.planar import PLANAR
from metaid.episode.pushed import SILENT, NoiseFloor
from metaid.episode.spatial import Spatial
from metaid.episode.windows import window_ends
from metaid.errors import EpisodeError
from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant import ArmStart


@dataclass(frozen=True, eq=False)
class Episode:
    """What is done to a plant with every candidate.

    Attributes:
        pushes: horizontal impulses at the link tips (npush x njoint), in N s; of an arm the joint speeds with which
            pushes begin, in rad/s or m/s.
        steps: after each push.
        fall_rule: when a link counts as fallen; of an arm only how fast a joint runs away, for it has ranges.
        keep_angles: whether the record keeps the joint angles.
        stiffness: k, in 1/s², of all pushes or of each (npush): the law also asks for q̈ = −k (q − q₀), q₀ being the
            pose of an arm at the start and the upright of a chain, so that the plant swings where it would coast
            (Eq. 13).
        deadband: in rad; a joint so near the upright is on neither side of it.
        seed: of the noise of a plant with faults.
        noise_floor: how much of it there is.
        lead: in s, for a plant whose torques come late: the law gets the angles that the speeds lead to by then.
        window_ends: in steps; the record keeps the motion up to each.
        poses: joint angles (npush x njoint), in rad or m, at which pushes begin; None for the upright.
        readings_steps: for how many steps after each push the record keeps what the sensors read.
        calibration: what was measured at a rig; readings that cannot be true end the episode.
        kind: of robot.
    """

    pushes: Array
    steps: int
    fall_rule: FallRule = USUAL_FALLS
    keep_angles: bool = False
    stiffness: float | Array = 0.0
    deadband: float = 0.0
    seed: int = 0
    noise_floor: NoiseFloor = SILENT
    lead: float = 0.0
    window_ends: tuple[int, ...] = ()
    poses: Array | None = None
    readings_steps: int = 0
    calibration: Calibrated | None = None
    kind: Kind = PLANAR

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise EpisodeError(f"steps is {self.steps} (allowed: 1 or more)")
        self.kind.check_pushes(self.pushes)
        if self.poses is not None and (self.poses.shape != self.pushes.shape or not np.isfinite(self.poses).all()):
            raise EpisodeError("poses: every push needs one, with a finite angle, in rad, for each joint")
        if np.shape(self.stiffness) not in ((), (self.npush,)) or not (self.springs >= 0.0).all():
            raise EpisodeError("every push needs a stiffness, in 1/s², of 0 or more")

    @property
    def states(self) -> Array:
        """The `poses` and the `pushes` (npush x 2 x njoint)."""
        poses = np.zeros(self.pushes.shape) if self.poses is None else self.poses
        return np.stack([poses, self.pushes], axis=1)

    @property
    def starts(self) -> list[Any]:
        """From where each push begins (npush)."""
        return [self.kind.start(pose, push) for pose, push in self.states]

    @property
    def begins(self) -> Array:
        """Joint angles and speeds with which pushes of an arm begin (npush x 2 x njoint), as far as is known."""
        return self.states if self.calibration is None else self.calibration.begun

    @property
    def springs(self) -> Array:
        """The stiffness of each push (npush), in 1/s²."""
        return np.full(self.npush, self.stiffness, dtype=np.float64)

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

    @property
    def npush(self) -> int:
        return len(self.pushes)

    @property
    def njoint(self) -> int:
        return int(self.pushes.shape[1])

    @property
    def total_steps(self) -> int:
        return self.steps * len(self.pushes)


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
