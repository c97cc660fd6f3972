"""What differs in an episode from one kind of robot to another."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Protocol

from metaid.episode.pushed import Pushed
from metaid.episode.record import Record, Seen
from metaid.models import Array


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

    def torques(self, law: Any, plant: Any, episode: Pushed) -> Callable[[int, Array, Array], Array]:
        """What a law sends the plant (njoint), in N m or N, after a push, by its number, at joint angles and speeds
        (njoint each).
        """

    def falls(self, episode: Pushed, speeds: Array, timestep: float) -> Callable[[Array, Array], bool]:
        """Whether a push has fallen at joint angles and speeds (njoint each), when it began with these `speeds`."""

    def record(self, seen: Seen, episode: Pushed) -> Record:
        """What an episode showed, but for its readings."""
