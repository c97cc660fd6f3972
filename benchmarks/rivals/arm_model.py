"""A serial arm along exciting trajectories: its model, linear in its base parameters, and what is recorded of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from benchmarks.rivals.benched import Benched, follow_on_bench
from benchmarks.rivals.conditions import Condition
from benchmarks.rivals.excitation import Limits, exciting
from benchmarks.rivals.logs import Log
from benchmarks.rivals.models import Motion
from benchmarks.rivals.servo import NO_FILTER, Followed, Sensors, Servo, read_and_command, recorded
from metaid.compiled import compiled
from metaid.compiled.spatial import frames_of
from metaid.estimation.twin.flow import flow
from metaid.estimation.twin.spatial import SpatialTwin
from metaid.estimation.twin.state import set_off
from metaid.estimation.twin.workspace import workspace
from metaid.models import Array
from metaid.models.tree import PARAMETERS, ArmPrior, Tree, joint_mass_matrix, joint_torque, torque_regressor
from metaid.plant import slope_weights

SPEED = 3.0  # rad/s of every joint at most, which is what metaid's pushes have
SWING, SHARE = 1.5, 0.4  # rad from the middle of a joint's range, and at most that share of the range
BANDWIDTH, NATURAL = 10.0, 0.2  # of the servo, in rad/s: with twice as much a PA-10 swings; of filters, in s
REVERSAL, WHOLLY = 0.2, 0.99  # rad/s, below which a joint reverses; of the time of a filter that it slides to one side
COULOMB = PARAMETERS.index("coulomb")


@dataclass(frozen=True)
class ArmModel:
    """An arm, of which there is a `arm_prior`, with the `timestep` in s. Its parameters are base parameters (nbase)."""

    arm_prior: ArmPrior
    timestep: float

    @property
    def njoint(self) -> int:
        return self.arm_prior.nominal.njoint

    @property
    def count(self) -> int:
        return len(self.arm_prior.values)

    @cached_property
    def prior(self) -> Array:
        whitening = np.linalg.pinv(self.arm_prior.root)
        return np.column_stack([whitening, whitening @ self.arm_prior.values])

    def regressor(self, motion: Motion) -> Array:
        every = torque_regressor(self.arm_prior.nominal, motion.angles, motion.speeds, motion.accelerations)
        joints = np.arange(self.njoint)
        every[:, joints, joints, COULOMB] = motion.sliding
        return every.reshape(*every.shape[:2], -1)[..., self.arm_prior.base.columns]

    def kept(self, motion: Motion) -> Array:
        """All but reversals, where dry friction is not what the columns have."""
        slides = (np.abs(motion.speeds) > REVERSAL) & (np.abs(motion.sliding) > WHOLLY)
        return slides.astype(np.float64)

    def follow(self, parameters: Array, servo: Servo, sensors: Sensors) -> Followed | None:
        whole = self.arm_prior.parameters_at(parameters)
        return follow_arm(self.arm_prior.nominal, whole, self.timestep, servo, sensors)

    def point(self, parameters: Array) -> Array:
        """What is independent of each other and of standard deviation 1 in what is believed."""
        change = parameters - self.arm_prior.values
        return np.asarray(np.linalg.lstsq(self.arm_prior.root, change, rcond=None)[0], dtype=np.float64)

    def parameters_at(self, point: Array) -> Array:
        return np.asarray(self.arm_prior.values + self.arm_prior.root @ point)


def record_arm(true: Tree, model: ArmModel, condition: Condition, seconds: float, seed: int, benched: Benched) -> Log:
    """An arm along exciting trajectories, under a servo in each joint as its maker has tuned it: its gains are the true
    inertias of the joints. Forward are sent the torques of the nominal model.

    Args:
        true: the arm.
        model: what is believed of it.
        condition: what is wrong with it.
        seconds: of motion.
        seed: of the trajectories and of all noise.
        benched: the arm on the bench.
    """
    nominal, timestep, n = model.arm_prior.nominal, model.timestep, true.njoint
    scale = np.sqrt(np.diag(model.arm_prior.covariance))

    def rows(angles: Array, speeds: Array, accelerations: Array) -> Array:
        every = torque_regressor(nominal, angles, speeds, accelerations)
        return every.reshape(*every.shape[:2], -1)[..., model.arm_prior.base.columns] * scale

    desired = exciting(rows, limits_of(nominal), timestep, seconds, seed)
    steps = len(desired.angles)
    inertias = np.diagonal(joint_mass_matrix(true, desired.angles[::50]), axis1=1, axis2=2).mean(axis=0)
    servo = Servo(
        desired.angles,
        desired.speeds,
        joint_torque(nominal, desired.angles, desired.speeds, desired.accelerations),
        np.ascontiguousarray(np.broadcast_to(np.diag(inertias), (steps, n, n))),
        BANDWIDTH,
        np.zeros((steps, n, n)),
    )
    weights = NO_FILTER if condition.settings.speed_sensor else slope_weights(timestep)
    return Log(model, NATURAL, timestep, servo, weights, follow_on_bench(benched, servo, weights, seed), condition)


def limits_of(tree: Tree) -> Limits:
    """Of an arm's trajectories, about the middle of its joints' ranges."""
    low, high = np.where(np.isfinite(tree.low), tree.low, -np.pi), np.where(np.isfinite(tree.high), tree.high, np.pi)
    return Limits((low + high) / 2.0, np.minimum(SWING, SHARE * (high - low)), SPEED)


def misplaced(tree: Tree, seed: int, shift: float, turn: float) -> Tree:
    """The same arm with each joint beside its place by `shift`, in m, and turned by `turn`, in rad, both at random."""
    random = np.random.default_rng([seed, tree.njoint, 2])
    ways, axes = (_directions(random, tree.njoint) for _ in range(2))
    turned = np.stack([rotation @ _rotation(turn * axis) for rotation, axis in zip(tree.rotation, axes, strict=True)])
    return replace(tree, position=tree.position + shift * ways, rotation=turned)


def _directions(random: np.random.Generator, count: int) -> Array:
    drawn = random.standard_normal((count, 3))
    return np.asarray(drawn / np.linalg.norm(drawn, axis=1, keepdims=True))


def _rotation(vector: Array) -> Array:
    """About a `vector`, by its length in rad."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * skew @ skew)


def follow_arm(tree: Tree, parameters: Array, timestep: float, servo: Servo, sensors: Sensors) -> Followed:
    """The model of an arm along a trajectory that begins where the servo's does, with its speeds. Dry friction builds
    up over a way, as a twin has it.

    Args:
        tree: where its joints are.
        parameters: of them and of its links (njoint x 13).
        timestep: in s.
        servo: what drives it.
        sensors: what it sees of it.
    """
    n = tree.njoint
    robot = SimpleNamespace(njoint=n, tilts=2, frames=frames_of(tree), parameters=lambda _: parameters)
    driven: Any = SimpleNamespace(law=None, is_continuous=True)
    twin = SpatialTwin(robot, np.empty(0))
    balance, _ = twin.moving(driven)
    start = np.array([servo.angles[0] - sensors.offset, servo.speeds[0]])
    arm = balance, workspace(*twin.space, 0, is_continuous=True), np.zeros((1, n))
    return recorded(servo, lambda *read: _follow_arm(arm, start, timestep, servo.driven, sensors.seen, *read))


@compiled
def _follow_arm(arm, start, timestep, driven, seen, angles, speeds, torques):  # type: ignore[no-untyped-def]
    """Fills `angles`, `speeds` (nstep + 1 x njoint) and `torques` (nstep x njoint); returns the steps before it was
    lost.
    """
    balance, work, held = arm
    offset, weights, delay, _ = seen
    steps, n = torques.shape
    set_off(start, 0, 0, work)
    for step in range(steps + 1):
        if not read_and_command(step, work.angle, work.speed, driven, offset, weights, angles, speeds, torques):
            return step
        if step == steps:
            break
        for i in range(n):
            held[0, i] = torques[step - delay, i] if step >= delay else 0.0
        if not flow(0, held, balance, None, None, timestep, True, work):
            return step
    return steps
