"""What a perturb-and-count episode is.

An episode is a number of pushes. For each, the plant is brought to rest upright, pushed, and for a fixed number of
steps sent nothing but the torque that a candidate's lumps say would cancel gravity and Coriolis forces. The first
fall ends the whole episode.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.errors import EpisodeError
from metaid.models import Array

FALL_LIMIT = np.pi / 2  # rad

RICH_FALL_LIMIT = np.pi  # rad; a link that is pushed to 60° on purpose has not fallen at 90°

FALL_MARGIN = 1.5  # past the limit, a link this many times faster than any was right after the push has fallen


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

    A `fall_margin` of 0 means that a link past the limit has fallen however slow it is. With a `stiffness` k, in 1/s²,
    the law also asks for q̈ = −k q, so that the plant swings where it would coast (Eq. 16). For a plant with faults: a
    joint within `deadband` (rad) of the upright is on neither side of it; `seed` is of the noise, and `noise_floor` how
    much of it there is. The law is told the angles that the speeds lead to after `lead` seconds, for a plant whose
    torques come late. The record keeps the motion up to each of the `window_ends`, in steps.
    """

    pushes: Array
    steps: int
    fall_limit: float = FALL_LIMIT
    fall_margin: float = FALL_MARGIN
    keep_angles: bool = False
    stiffness: float = 0.0
    deadband: float = 0.0
    seed: int = 0
    noise_floor: NoiseFloor = SILENT
    lead: float = 0.0
    window_ends: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise EpisodeError(f"steps is {self.steps} (allowed: 1 or more)")
        if not np.isfinite(self.pushes).all() or not np.any(self.pushes, axis=1).all():
            raise EpisodeError(
                "every push needs a finite impulse, in N s, on at least one link: without a push nothing moves"
            )

    @property
    def total_steps(self) -> int:
        return self.steps * len(self.pushes)
