"""What a film is made of: where a plant stands, and how it moves under the law of a candidate.

A `Stage` is one plant that is filmed. A chain is filmed after the last push of an episode, an arm from home, moving
slowly: where the law is right it goes on as it set out, as if nothing weighed anything.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from mujoco import MjModel

from metaid.compiled import Objective, fastest_loop
from metaid.episode import FallRule, arm_episode
from metaid.models import Array, Lumps
from metaid.models.tree import Tree
from metaid.plant import ArmPlant, ArmStart, MujocoPlant
from metaid.show.rendering import Camera
from metaid.show.scene import arm_scene, front_camera, scene, side_camera

FILM_SECONDS = 20.0  # of the motion of a chain at most
ARM_SECONDS = 4.0
SLOW, SLIDING = 0.2, 0.05  # rad/s and m/s at which the joints of an arm set out
RUNAWAY = 20.0  # times that fast: a film shows a fall for longer than an episode does


@dataclass(frozen=True)
class Clip:
    """What a panel of a film shows: joint `angles` (nframe x njoint), in rad, under a `caption`."""

    caption: str
    angles: Array


@dataclass(frozen=True)
class ChainStage:
    """The simulated chain of an `objective`, in whose episode it is filmed. Laws are lumps."""

    objective: Objective

    @property
    def plant(self) -> MujocoPlant:
        """That is filmed: an objective of another is refused before."""
        assert isinstance(self.objective.plant, MujocoPlant)
        return self.objective.plant

    def motion(self, law: Lumps, caption: str, rate: int) -> Clip:
        """What a panel shows under the `law` of a candidate, with `rate` frames a second: the very episode, faults and
        noise included, whose numbers the objective gives. Of a plant with sensors that err it is what they read.
        """
        candidate = Objective(self.plant, law, self.objective.episode, self.objective.measure.name)
        record, trajectory = candidate.watch(np.ones(len(law.vector)))
        last = min(len(trajectory.angles), FILM_SECONDS / record.timestep)
        steps = np.arange(0.0, last, 1.0 / (rate * record.timestep)).astype(int)
        return Clip(f"{caption}: falls" if record.fall_step is not None else caption, trajectory.angles[steps])

    @property
    def model(self) -> MjModel:
        """What is drawn."""
        return scene(self.plant)

    def poses(self, angles: Array) -> Array:
        """Coordinates of all joints of the model (... x nq) where those that move are at `angles` (... x njoint)."""
        return angles

    def camera(self, poses: Array) -> Camera:
        """From where all these `poses` (... x nq) are seen."""
        return front_camera(self.plant.chain, poses)


@dataclass(frozen=True)
class ArmStage:
    """A simulated arm with the shapes of its file, with its `nominal` arm. Laws are parameters
    (njoint x 13).
    """

    plant: ArmPlant
    nominal: Tree

    def motion(self, law: Array, caption: str, rate: int) -> Clip:
        """From home, every joint moving slowly towards the middle of its range."""
        plant, start = self.plant, slow_start(self.plant)
        steps = max(round(ARM_SECONDS / plant.timestep), 1)
        ends = np.unique(np.arange(1.0 / rate, ARM_SECONDS, 1.0 / rate) / plant.timestep).round().astype(int)
        watched: dict[str, Any] = {"fall_rule": FallRule(runaway=RUNAWAY), "window_ends": tuple(ends.tolist())}
        episode = arm_episode(self.nominal, (start,), np.zeros(1), steps, **watched)
        record = fastest_loop(plant, episode, self.nominal.parameters).run(law)
        assert record.windows is not None, "it has window ends"
        seen = record.windows.angles[0, : record.windows.seen[0]]
        angles = np.concatenate([start.pose[None], seen])
        return Clip(f"{caption}: falls" if record.fell[0] else caption, angles)

    @cached_property
    def model(self) -> MjModel:
        return arm_scene(self.plant)

    def poses(self, angles: Array) -> Array:
        if self.model.nq == self.plant.njoint:
            return angles
        return np.apply_along_axis(self.plant.arm.whole.at, -1, angles)

    def camera(self, poses: Array) -> Camera:
        return side_camera(self.model, poses)


Stage = ChainStage | ArmStage


def slow_start(plant: ArmPlant) -> ArmStart:
    """At home, every joint moving slowly towards the middle of its range."""
    tree, home = plant.tree, plant.home
    is_limited = np.isfinite(tree.high - tree.low)
    middle = np.zeros(tree.njoint)
    middle[is_limited] = (tree.low[is_limited] + tree.high[is_limited]) / 2
    speeds = np.where(tree.slides, SLIDING, SLOW) * np.where(home > middle, -1.0, 1.0)
    return ArmStart(home, speeds)
