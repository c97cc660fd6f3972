"""Episodes of a simulated arm at full speed: MuJoCo's step, and between two of them the law of a candidate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np

from metaid.compiled.decorator import choose, compiled
from metaid.compiled.sensed_loop import SensedLoop, command, follow
from metaid.compiled.spatial.dynamics import Frames, Space, accelerating_torques, frames_of, kinetic_squares, new_space
from metaid.compiled.stages import Step
from metaid.episode import Episode, Spatial
from metaid.models import Array
from metaid.plant import ArmPlant


class SpatialLaw(NamedTuple):
    """The parameters (njoint x 13) of a law; joint coordinates and speeds at the starts (npush x 2 x njoint) and the
    stiffness of each push (npush). The joint accelerations that it asks for (njoint), and what it is worked out in.
    """

    frames: Frames
    parameters: Array
    starts: Array
    springs: Array
    pull: Array
    space: Space


class ArmWatch(NamedTuple):
    """A `law`; parameters of the `nominal` arm (njoint x 13); the timestep of the control, in s; least and largest
    coordinates and the speeds beyond which the arm has fallen (njoint each); `squares` as `Seen` has them; and what q̇
    gained in a step beyond the law (njoint).
    """

    law: SpatialLaw
    nominal: Array
    timestep: float
    bounds: tuple[Array, Array, Array]
    squares: Array
    jump: Array


def arm_law(frames: Frames, parameters: Array, episode: Episode) -> SpatialLaw:
    """A law of these `parameters` (njoint x 13) in an `episode` of an arm, whose joints are as the `frames` say."""
    n, pushed = len(parameters), (episode.states, episode.springs)
    return SpatialLaw(frames, np.array(parameters, order="C"), *pushed, np.zeros(n), new_space(n))


class ArmLoop(SensedLoop):
    """Episodes on a simulated arm."""

    def __init__(self, plant: ArmPlant, episode: Episode, step: Step | None = None) -> None:
        super().__init__(plant, episode, step)
        self._kind = cast(Spatial, episode.kind)
        self._frames, self._bounds = frames_of(self._kind.nominal), self._kind.bounds(episode)

    def sent(self, law: Array) -> ArmWatch:
        nominal, squares = np.array(self._kind.nominal.parameters, order="C"), np.zeros((2, self.episode.npush))
        self._squares, own = squares, arm_law(self._frames, law, self.episode)
        return ArmWatch(own, nominal, self.plant.timestep, self._bounds, squares, np.zeros(len(law)))


def commanded_arm_torques(
    frames: Frames, parameters: Array, episode: Episode, positions: Array, speeds: Array
) -> Array:
    """The torques that a law made of sensor readings (npush x nstep x njoint), in N m or N.

    Args:
        frames: of the arm.
        parameters: of the law (njoint x 13).
        episode: in which it was sent.
        positions: joint coordinates that it acted on (npush x nstep + 1 x njoint), in rad or m.
        speeds: of the joints as the law took them to be (npush x nstep + 1 x njoint), in rad/s or m/s.
    """
    torques = np.zeros((episode.npush, episode.steps, positions.shape[2]))
    _command_all(arm_law(frames, parameters, episode), positions, speeds, torques)
    return torques


@dataclass(frozen=True, eq=False)
class QuickSpatial(Spatial):
    """The same with the law compiled: a rig has no time to wait for it between two ticks."""

    def torques(self, law: Array, plant: Any, episode: Episode) -> Callable[[int, Array, Array], Array]:
        sent = arm_law(frames_of(self.nominal), law, episode)

        def torque(push: int, angles: Array, speeds: Array) -> Array:
            torques = np.empty(len(angles))
            _command(sent, push, np.ascontiguousarray(angles), np.ascontiguousarray(speeds), torques)
            return torques

        torque(0, *episode.states[0])  # compiled before a push begins
        return torque


@compiled
def _command(law, push, position, speed, torque):  # type: ignore[no-untyped-def]
    start, stiffness, pull = law.starts[push], law.springs[push], law.pull
    for i in range(pull.shape[0]):
        pull[i] = -stiffness * (position[i] - start[0, i])  # Eq. 56
    accelerating_torques(law.frames, law.parameters, position, speed, pull, law.space, torque)


@compiled
def _command_watched(watch, push, position, speed, torque):  # type: ignore[no-untyped-def]
    _command(watch.law, push, position, speed, torque)


@compiled
def _follow(watch, push, step, positions, speeds):  # type: ignore[no-untyped-def]
    (low, high, allowed), law, jump, before = watch.bounds, watch.law, watch.jump, speeds[step - 1]
    for i in range(jump.shape[0]):
        inside = low[i] <= positions[step, i] and positions[step, i] <= high[i]
        if not (inside and abs(speeds[step, i]) <= allowed[i]):
            return True
        jump[i] = speeds[step, i] - before[i] - watch.timestep * law.pull[i]
    moved, jumped = kinetic_squares(law.frames, watch.nominal, law.space, before, jump)
    watch.squares[0, push] += moved
    watch.squares[1, push] += jumped
    return False


@compiled
def _command_all(law, positions, speeds, torques):  # type: ignore[no-untyped-def]
    """Fills in the torques of all steps of all pushes."""
    for push in range(torques.shape[0]):
        for step in range(torques.shape[1]):
            _command(law, push, positions[push, step], speeds[push, step], torques[push, step])


choose(command, {ArmWatch: _command_watched})
choose(follow, {ArmWatch: _follow})
