"""Episodes of arms in space: let go at poses and speeds all over the joint ranges, weighed by a mass matrix."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from metaid.episode.pushed import Pushed
from metaid.episode.record import Record, Seen, windows_of
from metaid.errors import EpisodeError, ImplausiblePlant
from metaid.models import Array
from metaid.models.tree import Tree, joint_torque, kinetic_squares
from metaid.plant import ArmStart

AWAY, OTHER_SPEED = 0.1, 0.2  # rad or m, and a share of the fastest joint: a start farther off is another


@dataclass(frozen=True, eq=False)
class Spatial:
    """An arm, whose laws are parameters (njoint x 13). The mass matrix of a `nominal` arm is the metric of its motion,
    and its joint ranges bound that. A push that falls ends there; the others are none the worse for it. What its
    methods are for, `Planar` says.
    """

    nominal: Tree

    ends_at_fall: ClassVar[bool] = False
    measures: ClassVar[tuple[str, ...]] = ("kinetic",)

    def check_pushes(self, pushes: Array) -> None:
        if len(pushes) == 0 or not np.isfinite(pushes).all():
            raise EpisodeError("every push of an arm needs a pose and finite joint speeds")

    def start(self, pose: Array, push: Array) -> ArmStart:
        return ArmStart(pose, push)

    def torques(self, law: Array, plant: Any, episode: Pushed) -> Callable[[int, Array, Array], Array]:
        tree, springs, poses = self.nominal.with_parameters(law), episode.springs, episode.states[:, 0]
        return lambda push, angles, speeds: joint_torque(tree, angles, speeds, -springs[push] * (angles - poses[push]))

    def bounds(self, episode: Pushed) -> tuple[Array, Array, Array]:
        """Least and largest joint coordinates and the speeds (njoint each) beyond which an arm has fallen: of hinges
        and of slides a multiple of the fastest at any start.

        A push may begin beyond a range: that of a real arm is not known to the last digit.
        """
        poses, speeds = episode.states.swapaxes(0, 1)
        low, high = np.minimum(self.nominal.low, poses.min(axis=0)), np.maximum(self.nominal.high, poses.max(axis=0))
        fastest = np.abs(speeds).max(axis=0)
        allowed = np.full(len(fastest), np.inf)
        for kind in (True, False):
            alike = self.nominal.slides == kind
            if fastest[alike].any():
                allowed[alike] = episode.fall_rule.runaway * fastest[alike].max()
        return low, high, allowed

    def falls(self, episode: Pushed, speeds: Array, timestep: float) -> Callable[[Array, Array], bool]:
        low, high, allowed = self.bounds(episode)
        return lambda angles, speeds: not bool(((low <= angles) & (angles <= high) & (np.abs(speeds) <= allowed)).all())

    def record(self, seen: Seen, episode: Pushed) -> Record:
        (angles, speeds), timestep = seen.padded(episode.steps), seen.timestep
        before, ahead = speeds[:-1], (angles + episode.lead * speeds)[:-1]
        pull = -episode.springs[:, None] * (ahead - episode.states[:, 0])
        jumps, squares = np.diff(speeds, axis=0) - timestep * pull, seen.squares
        if squares is None:
            is_seen = np.arange(episode.steps)[:, None] < seen.steps - seen.fell
            each = (kinetic_squares(self.nominal, ahead, moved) for moved in (before, jumps))
            squares = np.array([np.where(is_seen, own, 0.0).sum(axis=0) for own in each])
        sums = np.zeros((2, *speeds.shape))
        sums[:, 1:] = timestep * np.cumsum(before**2, axis=0), np.cumsum(jumps**2, axis=0) / timestep
        uncounted = np.zeros(angles.shape, dtype=np.int64)
        windows = windows_of(seen, episode.window_ends, (angles, speeds, *sums), uncounted)
        shown = uncounted[0], np.zeros(angles.shape[1:]), timestep * squares[0], squares[1] / timestep
        return Record(timestep, seen.steps, seen.fell, *shown, windows=windows)


@dataclass(frozen=True, eq=False)
class KnownStarts:
    """Joint coordinates and speeds with which pushes of a rig were seen to begin (npush x 2 x njoint): `begun`."""

    begun: Array

    def check(self, plant: Any, push: int, _earlier: dict[bytes, Array]) -> StartCheck:
        return StartCheck(plant.name, push, self.begun[push])


@dataclass(frozen=True, eq=False)
class StartCheck:
    """Whether a `push` of a `plant` begins as it was seen to (2 x njoint)."""

    plant: str
    push: int
    begun: Array

    def begin(self, angles: Array, speeds: Array) -> None:
        """Takes in the reading right after the push (njoint each).  Raises ImplausiblePlant."""
        allowed = (AWAY, max(AWAY, OTHER_SPEED * float(np.abs(self.begun[1]).max())))
        for what, unit, seen, known, most in zip(
            ("is at", "turns at"), ("rad", "rad/s"), (angles, speeds), self.begun, allowed, strict=True
        ):
            for joint in np.flatnonzero(~(np.abs(seen - known) <= most))[:1]:
                raise ImplausiblePlant(
                    f"plant {self.plant}: push {self.push + 1}: joint {joint + 1} {what} {seen[joint]:.4g} {unit} at "
                    f"its start (allowed: {known[joint]:.4g} ± {most:.2g} {unit}, as when the study was created)"
                )

    def step(self, angles: Array, speeds: Array, torque: Array) -> None:
        """Nothing is known of the rest."""

    def finish(self) -> None:
        """Nothing is kept of it."""
