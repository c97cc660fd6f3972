"""Whether what a rig answers can be true.

A simulated plant cannot lie. A rig can: an encoder dies, a push goes wrong, an angle wraps. A trial of such readings
would be worse than none, for a chain whose readings stand still seems to coast perfectly. So every reading is compared
with the one before it, with the speeds that the push gave when the rig was calibrated, and with the largest forces that
the nominal model allows. The limits are wide. A rig with noise, with coarse encoders, or with slow speed sensors keeps
within them, and so does any fall.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.episode.pushes import natural_time
from metaid.episode.readings import FINEST
from metaid.errors import ImplausiblePlant
from metaid.models import Array, Chain, mass_matrix

UPRIGHT = 0.1  # rad from the upright in which a joint may be right after a push
DEVIATIONS = 8.0  # of the noise, that no reading differs by
WINDOW = 1.5  # natural times over which the angles are compared with the sum of the speeds, before both begin anew
DRIFT = 0.03  # rad by which they may differ after a window, of any cause,
GAIN = 0.05  # and by this share of the way, for a speed sensor whose scale is a little wrong,
LAG = 0.03  # s, and by what a speed sensor that lags so much has missed
SLACK = 0.5  # of the largest speed so far, by which a speed may differ from the slope of the angles in one step
LEAP = 5.0  # times the acceleration that the nominal model allows, a joint may have
COARSEST = 0.05  # rad: the resolution of an encoder that has not shown it yet
STUCK = 1e-3  # rad by which a joint may turn, by its speeds, while its angle stays the same
STOPPED = 0.05  # rad through which a joint would have coasted that has seemed to stop all at once
SLOPE = 0.03  # s before it stopped, over which its speed is that of the angles
FAST = 0.2  # of the fastest joint of a push: a slower one may stop
CONSTANT = 10  # steps in which speeds may stay the same to the last digit, whatever the angles do
COARSE_SPEED = 0.02  # of the largest speed: the resolution of a coarse speed sensor
AWAY, OTHER_SPEED = 0.1, 0.2  # rad or m, and a share of the fastest joint: a start of an arm farther off is another
REPLAYED = 0.02  # rad by which other torques would have turned a joint whose readings were there before

_Text = Callable[[int], str]  # of a joint, what was seen of it or expected


@dataclass(frozen=True, eq=False)
class Calibration:
    """What was measured at a rig before any trial, and its nominal model.

    Attributes:
        start_speeds: joint speeds (npush x njoint) right after each push, in rad/s.
        start_tolerance: by how much the same push may differ from them (npush x njoint), in rad/s.
        angle_noise: standard deviation of the angle readings at rest (njoint), in rad.
        speed_noise: of the speed readings (njoint), in rad/s.
        nominal: the chain whose forces bound the accelerations.
        gravity: in m/s².
    """

    start_speeds: Array
    start_tolerance: Array
    angle_noise: Array
    speed_noise: Array
    nominal: Chain
    gravity: float

    @property
    def begun(self) -> Array:
        return np.stack([np.zeros_like(self.start_speeds), self.start_speeds], axis=1)

    def check(self, plant: Any, push: int, earlier: dict[bytes, Array]) -> PushCheck:
        return PushCheck(plant.name, self, push, plant.timestep, earlier)


class _Unchanged:
    """For how many steps each of some readings (njoint) has stayed the same."""

    def __init__(self, readings: Array) -> None:
        self._first = readings
        self._steps = np.zeros(len(readings), dtype=np.int64)

    def take(self, readings: Array, tolerance: Array | float) -> NDArray[np.int64]:
        """Takes in the next `readings` (njoint), which are the same up to a `tolerance`."""
        same = np.abs(readings - self._first) <= tolerance
        self._steps = np.where(same, self._steps + 1, 0)
        self._first = np.where(same, self._first, readings)
        return self._steps


class PushCheck:
    """Compares the readings of one push, in their order; raises ImplausiblePlant at the first that cannot be true.

    Args:
        plant: its name, for the message.
        calibration: what was measured at it.
        push: number of the push, from 0.
        timestep: between two readings, in s.
        earlier: what was seen in earlier pushes, which `finish` adds this one to: by the digest of all readings, how
            far their torques had turned the links of the nominal model by themselves (njoint), in rad.
    """

    def __init__(
        self, plant: str, calibration: Calibration, push: int, timestep: float, earlier: dict[bytes, Array]
    ) -> None:
        self._plant = plant
        self._calibration = calibration
        self._push = push
        self._earlier = earlier
        self._timestep = timestep
        self._lumps = calibration.nominal.lumps
        self._weights = calibration.gravity * self._lumps.gravity
        self._two_joints = np.eye(len(self._weights)) + np.eye(len(self._weights), k=1)  # of a link: its own, the next
        natural = natural_time(calibration.nominal, calibration.gravity)
        self._window = max(round(WINDOW * natural / timestep), CONSTANT)
        self._slope_steps = max(round(SLOPE / timestep), 3)
        self._angle_noise = DEVIATIONS * calibration.angle_noise
        self._speed_noise = DEVIATIONS * calibration.speed_noise

    def begin(self, angles: Array, speeds: Array) -> None:
        """Takes in the reading right after the push: joint `angles` (njoint) in rad, `speeds` (njoint) in rad/s."""
        self._tick = 0
        self._refuse(
            np.abs(angles) > UPRIGHT + self._angle_noise,
            lambda joint: f"is at {angles[joint]:.4g} rad right after the push",
            lambda joint: f"within {UPRIGHT + self._angle_noise[joint]:.2g} rad of the upright",
        )
        expected = self._calibration.start_speeds[self._push]
        tolerance = self._calibration.start_tolerance[self._push]
        self._refuse(
            ~(np.abs(speeds - expected) <= tolerance),
            lambda joint: f"turns at {speeds[joint]:.4g} rad/s right after the push",
            lambda joint: f"{expected[joint]:.4g} ± {tolerance[joint]:.2g} rad/s, as when the study was created",
        )
        self._start_speed = float(np.abs(expected).max())
        self._fastest = max(self._start_speed, float(np.abs(speeds).max()))
        self._angles, self._speeds, self._turned = angles, speeds, self._timestep * speeds
        self._history = deque([angles], maxlen=self._slope_steps + 1)
        self._quantum = np.full(len(angles), COARSEST)
        self._force = np.zeros(len(angles))
        self._begin_window(angles, speeds)
        self._same = _Unchanged(angles)
        self._slope = np.zeros(len(angles))
        self._summed, self._still_speeds = np.zeros(len(angles)), speeds
        self._constant = _Unchanged(speeds)
        self._constant_from = angles
        self._digest = blake2b(angles.tobytes() + speeds.tobytes(), digest_size=16)
        self._once, self._twice = np.zeros((2, len(angles)))  # sums of the torques, and sums of these

    def _begin_window(self, angles: Array, speeds: Array) -> None:
        self._window_angles, self._window_speeds, self._window_steps = angles, speeds, 0
        self._integral, self._path = np.zeros(len(angles)), np.zeros(len(angles))

    def step(self, angles: Array, speeds: Array, torque: Array) -> None:
        """Takes in the reading after a step with that joint `torque` (njoint), in N m."""
        self._tick += 1
        turned, average = angles - self._angles, 0.5 * (speeds + self._speeds)
        bend = np.abs(turned - self._turned)
        self._check_change(speeds, torque)
        self._check_slope(turned, bend, speeds)
        self._check_window(angles, speeds, average)
        self._check_still(angles, speeds, average)
        self._check_constant(angles, speeds)
        for difference in (np.abs(turned), bend)[: self._tick]:  # the first bend is from a speed, not from two readings
            np.minimum(self._quantum, difference, out=self._quantum, where=difference > FINEST)
        self._fastest = max(self._fastest, float(np.abs(speeds).max()))
        self._angles, self._speeds, self._turned = angles, speeds, turned
        self._digest.update(angles.tobytes() + speeds.tobytes())
        self._once = self._once + torque
        self._twice = self._twice + self._once
        self._history.append(angles)
        if self._window_steps == self._window:
            self._begin_window(angles, speeds)

    def finish(self) -> None:
        """The push is over: no other push may have had the same readings to the last digit under other torques."""
        force = self._twice - np.append(self._twice[1:], 0.0)
        matrix = mass_matrix(self._lumps, np.zeros(len(force)))
        turned = self._timestep**2 * np.linalg.solve(matrix, force)
        gap = np.abs(turned - self._earlier.setdefault(self._digest.digest(), turned))
        self._refuse(
            gap > REPLAYED,
            lambda joint: "has the readings of an earlier trial, to the last digit, after every tick",
            lambda joint: (
                f"others, for other torques have turned link {joint + 1} by {gap[joint]:.2g} rad more or less"
            ),
        )

    def _check_change(self, speeds: Array, torque: Array) -> None:
        """No speed changes faster than the largest forces can change it that the nominal model allows."""
        turning = self._speeds.cumsum()
        matrix = mass_matrix(self._lumps, self._angles.cumsum())
        # Torques may come late, so the largest so far counts; on a link act that of its joint and of the next.
        self._force = np.maximum(self._force, self._two_joints @ np.abs(torque))
        force = self._force + self._weights + self._lumps.coriolis @ turning**2
        links = np.abs(np.linalg.inv(matrix)) @ force
        most = self._timestep * LEAP * (links @ self._two_joints) + 2.0 * self._speed_noise
        most += 2.0 * self._quantum / self._timestep  # of a speed that is the difference of two readings
        change = np.abs(speeds - self._speeds)
        self._refuse(
            ~(change <= most),
            lambda joint: f"changes its speed by {change[joint]:.4g} rad/s, to {speeds[joint]:.4g} rad/s, in one step",
            lambda joint: f"at most {most[joint]:.2g} rad/s, by {LEAP:g} times the forces of the nominal model",
        )

    def _check_slope(self, turned: Array, bend: Array, speeds: Array) -> None:
        """In one step a joint turns as its speed says; where it is accelerated, both the angles and the speeds show."""
        gap = np.abs(turned - self._timestep * speeds)
        jerked = np.minimum(bend, self._timestep * np.abs(speeds - self._speeds))
        noise = 2.0 * self._angle_noise + self._timestep * self._speed_noise + self._quantum
        most = self._timestep * SLACK * self._fastest + jerked + noise
        self._refuse(
            ~(gap <= most),
            lambda joint: f"turns by {turned[joint]:.4g} rad in one step",
            lambda joint: f"{self._timestep * speeds[joint]:.4g} ± {most[joint]:.2g} rad, by its speed",
        )

    def _check_window(self, angles: Array, speeds: Array, average: Array) -> None:
        """Over many steps a joint turns as its speeds say."""
        self._window_steps += 1
        self._integral = self._integral + self._timestep * average
        self._path = self._path + self._timestep * np.abs(average)
        went = angles - self._window_angles
        gap = np.abs(went - self._integral)
        noise = 2.0 * self._angle_noise + self._timestep * np.sqrt(self._window_steps) * self._speed_noise
        most = DRIFT + GAIN * self._path + LAG * np.abs(speeds - self._window_speeds) + noise
        self._refuse(
            ~(gap <= most),
            lambda joint: f"turns by {went[joint]:.4g} rad in {self._window_steps} steps",
            lambda joint: f"{self._integral[joint]:.4g} ± {most[joint]:.2g} rad, by its speeds",
        )

    def _check_still(self, angles: Array, speeds: Array, average: Array) -> None:
        """An angle stays the same only while its joint hardly moves, and no joint stops all at once."""
        steps = self._same.take(angles, 0.375 * self._angle_noise)  # within three deviations
        still = steps > 0
        self._summed = np.where(still, self._summed + self._timestep * average, 0.0)
        self._still_speeds = np.where(still, self._still_speeds, speeds)
        most = STUCK + self._angle_noise + 3.0 * self._quantum + LAG * np.abs(speeds - self._still_speeds)
        most += self._timestep * np.sqrt(steps) * self._speed_noise
        self._refuse(
            still & (np.abs(self._summed) > most),
            lambda joint: f"is at {angles[joint]:.4g} rad for {steps[joint] + 1} readings and does not move",
            lambda joint: f"to turn by {self._summed[joint]:.2g} ± {most[joint]:.2g} rad, by its speeds",
        )
        if len(self._history) < self._slope_steps + 1:
            return
        span = self._timestep * self._slope_steps
        self._slope = np.where(steps > 1, self._slope, np.abs(self._angles - self._history[0]) / span)
        least = np.maximum(FAST * self._start_speed, (6.0 * self._quantum + 2.0 * self._angle_noise) / span)
        coasted = self._slope * steps * self._timestep
        self._refuse(
            still & (self._slope > least) & (coasted > STOPPED + 2.0 * self._angle_noise + 10.0 * self._quantum),
            lambda joint: f"is at {angles[joint]:.4g} rad for {steps[joint] + 1} readings and does not move",
            lambda joint: f"to turn on, for it turned at {self._slope[joint]:.2g} rad/s right before",
        )

    def _check_constant(self, angles: Array, speeds: Array) -> None:
        """Where a speed stays the same to the last digit, the angle changes evenly."""
        steps = self._constant.take(speeds, 0.0)
        self._constant_from = np.where(steps > 0, self._constant_from, angles)
        elapsed = self._timestep * steps
        gap = np.abs(angles - self._constant_from - speeds * elapsed)
        noise = 2.0 * self._angle_noise + 2.0 * self._quantum
        most = 2.0 * STUCK + COARSE_SPEED * self._fastest * elapsed + noise
        self._refuse(
            (steps >= CONSTANT) & (gap > most),
            lambda joint: f"has the same speed, {speeds[joint]:.4g} rad/s, in {steps[joint] + 1} readings",
            lambda joint: f"another, for its angle is {gap[joint]:.2g} rad from where that leads to",
        )

    def _refuse(self, wrong: NDArray[np.bool_], seen: _Text, expected: _Text) -> None:
        """Raises ImplausiblePlant, about the first joint, where any joint is `wrong` (njoint)."""
        if wrong.any():
            joint = int(wrong.argmax())
            raise ImplausiblePlant(
                f"plant {self._plant}: push {self._push + 1}, tick {self._tick}: joint {joint + 1} {seen(joint)} "
                f"(expected: {expected(joint)})"
            )


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
        if (found := elsewhere(np.stack([angles, speeds]), self.begun, AWAY, OTHER_SPEED)) is not None:
            raise ImplausiblePlant(
                f"plant {self.plant}: push {self.push + 1}: {found[0]} at its start (allowed: {found[1]}, as when the "
                "study was created)"
            )

    def step(self, angles: Array, speeds: Array, torque: Array) -> None:
        """Nothing is known of the rest."""

    def finish(self) -> None:
        """Nothing is kept of it."""


def elsewhere(seen: Array, known: Array, away: float, share: float) -> tuple[str, str] | None:
    """Which joint of an arm a push does not begin with as it should, and what is allowed, in words; None where there is
    none.

    Args:
        seen: joint coordinates and speeds with which it begins (2 x njoint).
        known: those with which it should.
        away: how far off they may be, in rad or m, and in rad/s or m/s.
        share: of the fastest joint: how far off speeds may be where that is more.
    """
    fastest = max(away, share * float(np.abs(known[1]).max()))
    for kind, (verb, unit, most) in enumerate([("is at", "rad", away), ("turns at", "rad/s", fastest)]):
        for joint in np.flatnonzero(~(np.abs(seen[kind] - known[kind]) <= most))[:1]:
            allowed = f"{known[kind, joint]:.4g} ± {most:.2g} {unit}"
            return f"joint {joint + 1} {verb} {seen[kind, joint]:.4g} {unit}", allowed
    return None
