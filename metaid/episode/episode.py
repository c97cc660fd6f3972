"""What a perturb-and-count episode is.

An episode is a number of pushes. For each, the plant is brought to where the push begins, pushed or let go, and for a
fixed number of steps sent nothing but the torque that a candidate's law says would cancel gravity, Coriolis forces and
friction, or have it swing as on springs. What else differs between a planar chain and an arm is its kind: a chain is
struck at rest, counted about the upright, and through at the first fall; an arm is let go at poses and speeds all over
its joint ranges, and its motion is weighed by a mass matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from metaid.episode.falls import RICH_RUNAWAY, USUAL_FALLS, FallRule
from metaid.episode.plausible import Calibration, KnownStarts
from metaid.episode.record import Record, Seen, crossings, energies, windows_of
from metaid.episode.smoothing import SILENT, NoiseFloor
from metaid.episode.windows import window_ends
from metaid.errors import EpisodeError
from metaid.models import Array, ChainModel, Lumps
from metaid.models.tree import Tree, joint_torque, kinetic_squares
from metaid.plant import ArmStart, Plant, Start


@dataclass(frozen=True)
class Planar:
    """A planar chain; its laws are lumps. The first fall ends its episode, and not only its push; `measures` are
    those by which it can be measured.
    """

    ends_at_fall: ClassVar[bool] = True
    measures: ClassVar[tuple[str, ...]] = ("count", "crossing", "spectral", "smoothed")

    def check_pushes(self, pushes: Array) -> None:
        """Raises EpisodeError where nothing can begin with these (npush x njoint)."""
        if not np.isfinite(pushes).all() or not np.any(pushes, axis=1).all():
            raise EpisodeError(
                "every push needs a finite impulse, in N s, on at least one link: without a push nothing moves"
            )

    def start(self, pose: Array, push: Array) -> Start:
        """From where a push begins, by its pose and its impulses, or joint speeds of an arm (njoint each)."""
        return Start(push, pose)

    def torques(self, law: Lumps, plant: Plant, episode: Episode) -> Callable[[int, Array, Array], Array]:
        """What a law sends the plant (njoint), in N m or N, after a push, by its number, at joint angles and speeds
        (njoint each).
        """
        models = [ChainModel(law, plant.gravity, stiffness) for stiffness in episode.springs.tolist()]
        return lambda push, angles, speeds: models[push].torque(angles, speeds)

    def falls(self, episode: Episode, speeds: Array, timestep: float) -> Callable[[Array, Array], bool]:
        """Whether a push has fallen at joint angles and speeds (njoint each), when it began with these `speeds`."""
        rule = episode.fall_rule
        allowed = rule.allowed_speeds(np.cumsum(speeds))
        return lambda angles, speeds: rule.has_fallen(np.cumsum(angles), np.cumsum(speeds), allowed, timestep)

    def record(self, seen: Seen, episode: Episode) -> Record:
        """What an episode showed, but for its readings."""
        (angles, speeds), steps, pushes = seen.padded(episode.steps), seen.steps, np.arange(episode.npush)
        crosses = (episode.states[:, 0] == 0.0) & (speeds[0] != 0.0)
        crossed, span = crossings(angles, crosses, seen.timestep, episode.deadband)
        sums = energies(speeds, seen.timestep, -episode.springs[:, None] * angles[:-1])
        at_end = steps, pushes
        shown = crossed[at_end], span, sums[0][at_end], sums[1][at_end]
        kept = tuple(each.angles for each in seen.motions) if episode.keep_angles else ()
        windows = windows_of(seen, episode.window_ends, (angles, speeds, *sums), crossed)
        return Record(seen.timestep, steps, seen.fell, *shown, kept, episode.noise_floor.energy, windows)


PLANAR = Planar()


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

    def torques(self, law: Array, plant: Any, episode: Episode) -> Callable[[int, Array, Array], Array]:
        tree, springs, poses = self.nominal.with_parameters(law), episode.springs, episode.states[:, 0]
        return lambda push, angles, speeds: joint_torque(tree, angles, speeds, -springs[push] * (angles - poses[push]))

    def bounds(self, episode: Episode) -> tuple[Array, Array, Array]:
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

    def falls(self, episode: Episode, speeds: Array, timestep: float) -> Callable[[Array, Array], bool]:
        low, high, allowed = self.bounds(episode)
        return lambda angles, speeds: not bool(((low <= angles) & (angles <= high) & (np.abs(speeds) <= allowed)).all())

    def record(self, seen: Seen, episode: Episode) -> Record:
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


Kind = Planar | Spatial  # how pushes begin and end, what law they follow, and what they show


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
    calibration: Calibration | KnownStarts | None = None
    kind: Kind = PLANAR

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise EpisodeError(f"steps is {self.steps} (allowed: 1 or more)")
        if self.poses is not None and (self.poses.shape != self.pushes.shape or not np.isfinite(self.poses).all()):
            raise EpisodeError("poses: every push needs one, with a finite angle, in rad, for each joint")
        if np.shape(self.stiffness) not in ((), (self.npush,)) or not (self.springs >= 0.0).all():
            raise EpisodeError("every push needs a stiffness, in 1/s², of 0 or more")
        self.kind.check_pushes(self.pushes)

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
