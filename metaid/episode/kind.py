"""What differs in an episode from one kind of robot to another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array

if TYPE_CHECKING:
    from metaid.episode.episode import Episode
    from metaid.episode.record import Record

Motion = tuple[Array, Array]  # joint angles and speeds (nsteps + 1 x njoint) after a push


class Check(Protocol):
    """Compares the readings of one push of a rig with what can be true; raises ImplausiblePlant."""

    def begin(self, angles: Array, speeds: Array) -> None:
        """Takes in the reading right after the push (njoint each)."""

    def step(self, angles: Array, speeds: Array, torque: Array) -> None:
        """Takes in the next, to which a torque led (njoint each)."""

    def finish(self) -> None:
        """The push is over."""


class Calibrated(Protocol):
    """What was measured at a rig before any trial."""

    @property
    def begun(self) -> Array:
        """Joint angles and speeds with which each push began (npush x 2 x njoint)."""

    def check(self, plant: Any, push: int, earlier: dict[bytes, Array]) -> Check:
        """What the readings of a push, numbered from 0, are compared with; what was seen in `earlier` ones is known,
        and this one is added.
        """


@dataclass(frozen=True, eq=False)
class Seen:
    """What was seen of an episode, step by step: the `motions` of pushes that were begun, which of all pushes `fell`
    (npush), and the `timestep` between two torques, in s.
    """

    motions: Sequence[Motion]
    fell: NDArray[np.bool_]
    timestep: float

    @property
    def steps(self) -> NDArray[np.int64]:
        """That were run after each push (npush)."""
        steps = np.zeros(len(self.fell), dtype=np.int64)
        steps[: len(self.motions)] = [len(angles) - 1 for angles, _ in self.motions]
        return steps


class Kind(Protocol):
    """How pushes of a kind of robot begin and end, what law they follow, and what they show.

    `ends_at_fall`: whether the first fall ends the episode, and not only its push. `measures`: by which it can be
    measured.
    """

    ends_at_fall: ClassVar[bool]
    measures: ClassVar[tuple[str, ...]]

    def check_pushes(self, pushes: Array) -> None:
        """Raises EpisodeError where nothing can begin with these (npush x njoint)."""

    def start(self, pose: Array, push: Array) -> Any:
        """From where a push begins, by its pose and its impulses or speeds (njoint each)."""

    def torques(self, law: Any, plant: Any, episode: Episode) -> Callable[[int, Array, Array], Array]:
        """What a law sends the plant (njoint), in N m or N, after a push, by its number, at joint angles and speeds
        (njoint each).
        """

    def falls(self, episode: Episode, speeds: Array, timestep: float) -> Callable[[Array, Array], bool]:
        """Whether a push has fallen at joint angles and speeds (njoint each), when it began with these `speeds`."""

    def record(self, seen: Seen, episode: Episode) -> Record:
        """What an episode showed, but for its readings."""
