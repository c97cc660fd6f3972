"""What is recorded of a chain along exciting trajectories, for the methods that use torques."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.by_torque import inverse_dynamics_regressor
from benchmarks.chains import Links
from benchmarks.rivals.benched import chain_on_bench, follow_on_bench
from benchmarks.rivals.conditions import Condition
from benchmarks.rivals.excitation import Limits, exciting
from benchmarks.rivals.models import ChainModel, Model
from benchmarks.rivals.servo import NO_FILTER, Followed, Servo
from metaid.episode import natural_time
from metaid.errors import StudyError
from metaid.models import Array, Chain
from metaid.plant import chain_of, slope_weights

SWING, SPEED = 1.5, 6.0  # limits of every joint, in rad and rad/s
# Shares of the limits of trajectories, and whether the servo has the nominal change of the gravity torque, too: the
# first is taken with which control is kept.
ATTEMPTS = ((1.0, False), (1.0, True), (0.7, True), (0.5, True))
TIGHTNESS, OF_DRIVES = 4.0, 8.0  # of the servo, and of one in each drive, in rad per natural time
LOOPS = 100  # of a drive's own feedback in a timestep


@dataclass(frozen=True)
class Log:
    """What is known after recording.

    Attributes:
        model: what is believed of the rig.
        natural: time in s that filters are measured by.
        timestep: in s.
        servo: that drove it.
        weights: that made speeds of angles in the servo; see `Sensors`.
        seen: what was read and commanded.
        condition: whose `searched` faults are to be found.
    """

    model: Model
    natural: float
    timestep: float
    servo: Servo
    weights: Array
    seen: Followed
    condition: Condition

    @property
    def seconds(self) -> float:
        """Of motion."""
        return len(self.seen.torques) * self.timestep

    def first(self, seconds: float) -> Log:
        """Its first `seconds`."""
        steps = round(seconds / self.timestep)
        if steps > len(self.seen.torques):
            raise StudyError(f"control was lost before {seconds:g} s")
        seen = self.seen
        kept = Followed(seen.angles[: steps + 1], seen.speeds[: steps + 1], seen.torques[:steps])
        return replace(self, servo=self.servo.first(steps), seen=kept)


def record(
    true: Links,
    nominal: Links,
    condition: Condition,
    seconds: float,
    seed: int,
    by_drives: bool = False,
) -> Log:
    """A chain along exciting trajectories: forward the torques of the nominal model along them, and a feedback.

    Args:
        true: links of the rig.
        nominal: links that are believed.
        condition: what is wrong with it.
        seconds: of motion.
        seed: of the trajectories and of all noise.
        by_drives: whether each joint has a position servo of its own, with gains that stay the same and a tachometer
            without noise; else the feedback has the nominal mass matrix, and no other sensors than the condition has.
    """
    for attempt in ATTEMPTS:
        log = _recorded(true, nominal, condition, seconds, attempt, seed, by_drives)
        if len(log.seen.torques) == len(log.servo.angles):
            break
    return log


def _recorded(
    true: Links,
    nominal: Links,
    condition: Condition,
    seconds: float,
    attempt: tuple[float, bool],
    seed: int,
    by_drives: bool,
) -> Log:
    """The same, in one of the ATTEMPTS, up to where control was lost."""
    (share, balances), plant, believed = attempt, condition.plant(true), chain_of(nominal)
    timestep, gravity, n = plant.timestep, plant.gravity, believed.nlink
    model = ChainModel(believed, gravity, timestep, condition.searched)
    natural = natural_time(believed, gravity)

    def rows(angles: Array, speeds: Array, accelerations: Array) -> Array:
        return inverse_dynamics_regressor(angles, speeds, accelerations, gravity) * model.believed

    desired = exciting(rows, Limits(np.zeros(n), np.full(n, SWING), SPEED), timestep, seconds, seed, share)
    gains = joint_mass_matrices(believed, np.zeros_like(desired.angles) if by_drives else desired.angles)
    if by_drives:
        gains = np.asarray(np.eye(n) / np.diagonal(np.linalg.inv(gains), axis1=1, axis2=2)[:, None])
    servo = Servo(
        desired.angles,
        desired.speeds,
        rows(desired.angles, desired.speeds, desired.accelerations).sum(axis=2),
        gains,
        (OF_DRIVES if by_drives else TIGHTNESS) / natural,
        gravity_stiffness(believed, desired.angles, gravity) * (balances and not by_drives),
    )
    weights = NO_FILTER if condition.settings.speed_sensor or by_drives else slope_weights(timestep)
    seen = follow_on_bench(
        chain_on_bench(true, nominal, condition, seed), servo, weights, seed, LOOPS if by_drives else 1
    )
    return Log(model, natural, timestep, servo, weights, seen, condition)


def joint_mass_matrices(chain: Chain, angles: Array) -> Array:
    """Mass matrices in joint angles (ntime x njoint x njoint), in kg m², along joint `angles` (ntime x njoint)."""
    matrices = chain.mass_matrix(np.cumsum(angles, axis=1))
    for axis in (1, 2):
        matrices = np.flip(np.cumsum(np.flip(matrices, axis), axis=axis), axis)
    return np.ascontiguousarray(matrices)


def gravity_stiffness(chain: Chain, angles: Array, gravity: float) -> Array:
    """By how much the torque that holds a chain falls with each joint angle (ntime x njoint x njoint), in N m/rad.

    Along joint `angles` (ntime x njoint), in rad; `gravity` in m/s².
    """
    weights = gravity * chain.lumps.gravity * np.cos(np.cumsum(angles, axis=1))
    above = np.cumsum(weights[:, ::-1], axis=1)[:, ::-1]
    links = np.arange(chain.nlink)
    return np.ascontiguousarray(above[:, np.maximum.outer(links, links)])
