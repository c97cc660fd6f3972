"""What a perturb-and-count episode is.

An episode is a number of pushes. For each, the plant is brought to rest where the push begins, pushed, and for a fixed
number of steps sent nothing but the torque that a candidate's lumps say would cancel gravity and Coriolis forces. The
first fall ends the whole episode.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from metaid.episode.falls import USUAL_FALLS, FallRule
from metaid.episode.plausible import Calibration
from metaid.episode.windows import window_ends
from metaid.errors import EpisodeError
from metaid.models import Array
from metaid.plant import Start


@dataclass(frozen=True)
class NoiseFloor:
    """What an episode's readings would show of a plant at rest: the `energy` ∫ q̈² dt of all pushes and joints, in
    rad²/s³; the `frequency` that it looks like, in Hz; and the root of the standard deviation of its square, `spread`,
    in Hz.
    """

    energy: float
    frequency: float
    spread: float


SILENT = NoiseFloor(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Episode:
    """`pushes` (npush x njoint), horizontal impulses at the link tips in N s; `steps` after each; when a link counts
    as fallen; whether the record keeps the joint angles.

    Pushes begin upright, or at the joint angles `poses` (npush x njoint), in rad. With a `stiffness` k, in 1/s², the
    law also asks for q̈ = −k q, so that the plant swings where it would coast (Eq. 16). For a plant with faults: a joint
    within `deadband` (rad) of the upright is on neither side of it; `seed` is of the noise, and `noise_floor` how much
    of it there is. For a plant whose torques come late, the law gets the angles that the speeds lead to after `lead`
    seconds. The record keeps the motion up to each of the `window_ends`, in steps, and what the sensors read in the
    first `readings_steps` after each push. With a `calibration` of a rig, readings that cannot be true end the episode.
    """

    pushes: Array
    steps: int
    fall_rule: FallRule = USUAL_FALLS
    keep_angles: bool = False
    stiffness: float = 0.0
    deadband: float = 0.0
    seed: int = 0
    noise_floor: NoiseFloor = SILENT
    lead: float = 0.0
    window_ends: tuple[int, ...] = ()
    poses: Array | None = None
    readings_steps: int = 0
    calibration: Calibration | None = None

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise EpisodeError(f"steps is {self.steps} (allowed: 1 or more)")
        if not np.isfinite(self.pushes).all() or not np.any(self.pushes, axis=1).all():
            raise EpisodeError(
                "every push needs a finite impulse, in N s, on at least one link: without a push nothing moves"
            )
        if self.poses is not None and (self.poses.shape != self.pushes.shape or not np.isfinite(self.poses).all()):
            raise EpisodeError("poses: every push needs one, with a finite angle, in rad, for each joint")

    @property
    def starts(self) -> list[Start]:
        """From where each push begins (npush)."""
        poses = np.zeros(self.pushes.shape) if self.poses is None else self.poses
        return [Start(*each) for each in zip(self.pushes, poses, strict=True)]

    def shortened(self, steps: int) -> Episode:
        """The first push alone, for at most that many `steps`, with windows."""
        steps = min(steps, self.steps)
        poses = None if self.poses is None else self.poses[:1]
        kept = min(self.readings_steps, steps)
        first = replace(self, pushes=self.pushes[:1], poses=poses, steps=steps, readings_steps=kept)
        return replace(first, window_ends=window_ends(steps))

    @property
    def npush(self) -> int:
        return len(self.pushes)

    @property
    def njoint(self) -> int:
        return int(self.pushes.shape[1])

    @property
    def total_steps(self) -> int:
        return self.steps * len(self.pushes)
