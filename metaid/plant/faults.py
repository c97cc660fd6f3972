"""What a real plant has and an ideal one has not: the `[faults]` of a plant file, and the noise of one episode.

All noise of an episode is drawn before it, from a stream of random numbers that the study's seed and the trial's number
alone determine. So a trial has the same noise wherever it is evaluated, and however often. The candidate does not
matter: its factors differ in their last bits from one processor to another, and noise must not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from metaid.files import Settings
from metaid.models import Array

SPEED_WINDOW = 0.03  # s of angle readings that a joint speed is fitted to where there is no speed sensor
FEWEST_READINGS = 3  # of them, however slowly they come

Size = Annotated[float, Field(ge=0, le=1e6)]
Limit = Annotated[float, Field(gt=0, le=1e9)]
Angle = Annotated[float, Field(ge=-1, le=1)]
Gain = Annotated[float, Field(ge=0.1, le=10)]
PER_JOINT = ("torque_limit", "torque_gain", "encoder_offset")  # one number for all joints, or one each


def of_each(given: float | tuple[float, ...] | None, count: int) -> Array:
    """What is `given` of each joint, or each axis of a tilt (count): one number for all, or one each; None is no limit,
    so inf.
    """
    return np.full(count, np.inf if given is None else given, dtype=np.float64)


class FaultSettings(Settings):
    """The `[faults]` table of a plant file; every fault is off unless it is named. Noise is normal, its size the
    standard deviation.

    Sensors: `angle_noise` in rad, `speed_noise` in rad/s; `speed_sensor = false`, then speeds are those of a straight
    line through the last angle readings; `encoder_step`, the resolution of an angle reading in rad; `encoder_offset`,
    what is read where a joint is straight, in rad, and pushes begin where encoders read the upright. Control: a new
    torque `control_every` physics steps, `delay` in such control steps. Drives: `torque_limit` in N m, one for all
    joints or one each, `torque_noise` in N m, anew for every control step; `torque_gain`, what a motor delivers of what
    it is told to, as a multiple of it. `push_noise`: of every impulse, as a share of it, or of every joint speed that
    an arm is to begin with. `tilt`: of the base, in rad; of a chain one number, positive towards positive angles, of
    an arm two, about the x and then the y axis of its base.
    """

    angle_noise: Size = 0.0
    speed_noise: Size = 0.0
    speed_sensor: bool = True
    encoder_step: Annotated[float, Field(ge=0, le=1)] = 0.0
    encoder_offset: Angle | Annotated[tuple[Angle, ...], Field(min_length=1, strict=False)] = 0.0
    control_every: Annotated[int, Field(ge=1, le=1000)] = 1
    delay: Annotated[int, Field(ge=0, le=1000)] = 0
    torque_limit: Limit | Annotated[tuple[Limit, ...], Field(min_length=1, strict=False)] | None = None
    torque_gain: Gain | Annotated[tuple[Gain, ...], Field(min_length=1, strict=False)] = 1.0
    torque_noise: Size = 0.0
    push_noise: Annotated[float, Field(ge=0, le=1)] = 0.0
    tilt: Angle | Annotated[tuple[Angle, Angle], Field(strict=False)] = 0.0

    @property
    def named(self) -> dict[str, object]:
        """The faults that are on, with their size."""
        return {name: value for name, value in self if value != type(self).model_fields[name].default}

    @property
    def is_noisy(self) -> bool:
        """Whether two episodes that are alike differ."""
        return any((self.angle_noise, self.speed_noise, self.torque_noise, self.push_noise))

    def without(self, searched: Sequence[str]) -> FaultSettings:
        """The same but for faults that are `searched`, by the kinds of `metaid.plant.unknown_faults`: these are off."""
        keys = {
            "delay": "delay",
            "tilt": "tilt",
            "offset": "encoder_offset",
            "gain": "torque_gain",
            "limit": "torque_limit",
        }
        off = {key: type(self).model_fields[key].default for kind, key in keys.items() if kind in searched}
        return self.model_copy(update=off)

    def control_period(self, timestep: float) -> float:
        """Time between two torques, and between two readings, in s, where a physics step is a `timestep`."""
        return timestep * self.control_every

    def misfits(self, njoint: int, tilts: int) -> str | None:
        """What does not suit a plant of `njoint` joints whose base tilts about so many axes; None where all does."""
        for key in PER_JOINT:
            given = getattr(self, key)
            if isinstance(given, tuple) and len(given) != njoint:
                return f"faults: {key} has {len(given)} numbers (allowed: one, or {njoint})"
        if tilts == 1 and isinstance(self.tilt, tuple):
            return "faults: tilt has 2 numbers (allowed: one, for a chain tilts in its plane)"
        if tilts == 2 and not isinstance(self.tilt, tuple) and self.tilt:
            return "faults: tilt has one number (allowed: two, about the x and the y axis of an arm's base)"
        return None


@dataclass(frozen=True)
class Noise:
    """What chance adds in one episode: to every impulse, as a share of it (npush x njoint); to the `angles` in rad and
    `speeds` in rad/s that are read (npush x nsteps + 1 x njoint), the reading right after the push first; to the
    `torques` in N m (npush x nsteps x njoint).
    """

    impulses: Array
    angles: Array
    speeds: Array
    torques: Array


def stream(seed: int, number: int) -> np.random.Generator:
    """The random numbers of the episode of the trial of that `number`, in a study with that `seed`."""
    return np.random.Generator(np.random.SFC64([seed, number]))


def draw(faults: FaultSettings, random: np.random.Generator, npush: int, steps: int, njoint: int) -> Noise:
    """The noise of an episode.

    Args:
        faults: the sizes of the noise.
        random: where it is drawn from; see `stream`.
        npush: the number of pushes.
        steps: control steps after each push.
        njoint: the number of joints.
    """

    def normal(size: float, *shape: int) -> Array:
        return size * random.standard_normal(shape) if size else np.zeros(shape)

    return Noise(
        impulses=normal(faults.push_noise, npush, njoint),
        angles=normal(faults.angle_noise, npush, steps + 1, njoint),
        speeds=normal(faults.speed_noise, npush, steps + 1, njoint),
        torques=normal(faults.torque_noise, npush, steps, njoint),
    )


def readings(angles: Array, encoder_step: float) -> Array:
    """What an encoder shows of `angles` (...), in rad: the nearest multiple of its step."""
    return np.floor(angles / encoder_step + 0.5) * encoder_step if encoder_step else angles


def slope_weights(period: float) -> Array:
    """What the last angle readings (nreading), one every `period` in s, are weighted with for the speed: the slope of
    the straight line that fits them best, in 1/s.

    A line, as an exactly compensated pendulum moves on one: there the filter does not lag.
    """
    count = max(round(SPEED_WINDOW / period) + 1, FEWEST_READINGS)
    times = period * (np.arange(count) - 0.5 * (count - 1))
    weights: Array = times / (times**2).sum()
    return weights
