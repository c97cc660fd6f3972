"""How an episode pushes a robot of whatever kind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.episode.falls import USUAL_FALLS, FallRule
from metaid.episode.smoothing import SILENT, NoiseFloor
from metaid.errors import EpisodeError
from metaid.models import Array


@dataclass(frozen=True, eq=False)
class Pushed:
    """What is done to a plant with every candidate, but for what depends on its kind.

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

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise EpisodeError(f"steps is {self.steps} (allowed: 1 or more)")
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
    def springs(self) -> Array:
        """The stiffness of each push (npush), in 1/s²."""
        return np.full(self.npush, self.stiffness, dtype=np.float64)

    @property
    def npush(self) -> int:
        return len(self.pushes)

    @property
    def njoint(self) -> int:
        return int(self.pushes.shape[1])

    @property
    def total_steps(self) -> int:
        return self.steps * len(self.pushes)
