"""What an episode of an arm is.

An episode is a number of pushes. For each, a position controller brings the arm to a pose and to joint speeds. From
there on it is sent nothing but the torque of a candidate. On some pushes it is to coast, on others to swing about its
pose as on springs. A push that falls ends there; the others are none the worse for it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.episode.windows import window_ends
from metaid.errors import EpisodeError
from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant import ArmStart

RUNAWAY = 5.0  # times the fastest joint at the start of any push: a joint that is faster has run away


@dataclass(frozen=True, eq=False)
class ArmEpisode:
    """What is done to an arm with every candidate.

    Attributes:
        starts: from where each push begins (npush).
        stiffness: k (npush), in 1/s²: the law asks for q̈ = −k (q − q₀), q₀ being the pose at the start.
        steps: of each push.
        window_ends: up to which steps the motion is kept.
        runaway: a joint this many times faster than any was at a start has fallen, hinges and slides apart; so has
            one that leaves its range.
        seed: of the noise.
        begun: joint coordinates and speeds with which pushes of a rig were seen to begin (npush x 2 x njoint); None
            where they are those of the starts.
        lead: in s, for a plant whose torques come late: the law gets the coordinates that the speeds lead to by then.
        keeps_readings: whether what the sensors read is kept, as of a plant with faults.
    """

    starts: tuple[ArmStart, ...]
    stiffness: Array
    steps: int
    window_ends: tuple[int, ...] = ()
    runaway: float = RUNAWAY
    seed: int = 0
    begun: Array | None = None
    lead: float = 0.0
    keeps_readings: bool = False

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise EpisodeError(f"steps is {self.steps} (allowed: 1 or more)")
        if not self.starts or self.stiffness.shape != (len(self.starts),):
            raise EpisodeError("every push of an arm needs a start and a stiffness, in 1/s², which may be 0")
        if not (np.isfinite(self.states).all() and np.isfinite(self.stiffness).all() and (self.stiffness >= 0).all()):
            raise EpisodeError("every start needs finite coordinates and speeds, and a stiffness of 0 or more")

    @property
    def npush(self) -> int:
        return len(self.starts)

    @property
    def njoint(self) -> int:
        return len(self.starts[0].pose)

    @property
    def readings_steps(self) -> int:
        """For how many steps after a push readings are kept."""
        return self.steps if self.keeps_readings else 0

    @property
    def total_steps(self) -> int:
        return self.steps * self.npush

    @cached_property
    def states(self) -> Array:
        """Joint coordinates and speeds at the start of each push (npush x 2 x njoint)."""
        return np.array([(start.pose, start.speeds) for start in self.starts], dtype=np.float64)

    @property
    def begins(self) -> Array:
        """Joint coordinates and speeds with which pushes begin (npush x 2 x njoint), as far as is known."""
        return self.states if self.begun is None else self.begun

    def allowed_speeds(self, slides: NDArray[np.bool_]) -> Array:
        """The speed (njoint) beyond which each joint has run away, in rad/s or m/s, by which of them are `slides`."""
        fastest = np.abs(self.states[:, 1]).max(axis=0)
        limits = np.full(len(fastest), np.inf)
        for kind in (True, False):
            alike = slides == kind
            if fastest[alike].any():
                limits[alike] = self.runaway * fastest[alike].max()
        return limits

    def bounds(self, tree: Tree) -> tuple[Array, Array, Array]:
        """Least and largest joint coordinates and the speeds (njoint each) beyond which an arm has fallen.

        A push may begin beyond a range: that of a real arm is not known to the last digit.
        """
        poses = self.states[:, 0]
        low, high = np.minimum(tree.low, poses.min(axis=0)), np.maximum(tree.high, poses.max(axis=0))
        return low, high, self.allowed_speeds(tree.slides)

    def shortened(self, steps: int) -> ArmEpisode:
        """A push of each stiffness, for at most that many `steps`, with windows."""
        steps = min(steps, self.steps)
        first = sorted(np.unique(self.stiffness, return_index=True)[1].tolist())
        starts = tuple(self.starts[push] for push in first)
        begun = None if self.begun is None else self.begun[first]
        changed = replace(self, starts=starts, stiffness=self.stiffness[first], begun=begun)
        return replace(changed, steps=steps, window_ends=window_ends(steps))
