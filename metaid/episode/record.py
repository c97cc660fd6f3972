"""What an episode showed: sums and crossings of each joint's motion after each push."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.episode.readings import SensorReadings
from metaid.episode.windows import Windows, windows_before_fall
from metaid.models import Array

ALIKE = 1e-9  # relative: how far two loops may differ that take the same steps


class States(NamedTuple):
    """Joint `angles` in rad and `speeds` in rad/s after a push (nsteps + 1 x njoint each), from right after it on; the
    `times` since then (nsteps + 1), in s, where the plant tells them.
    """

    angles: Array
    speeds: Array
    times: Array | None = None


@dataclass(frozen=True, eq=False)
class Seen:
    """What was seen of an episode, step by step: the `motions` of pushes that were begun, which of all pushes `fell`
    (npush), and the `timestep` between two torques, in s. Of an arm whose loop works them out, sums of q̇ᵀ M̄ q̇ and of
    the same of what q̇ gained beyond the law, M̄ being the nominal mass matrix: `squares` (2 x npush).
    """

    motions: Sequence[States]
    fell: NDArray[np.bool_]
    timestep: float
    squares: Array | None = None

    @property
    def steps(self) -> NDArray[np.int64]:
        """That were run after each push (npush)."""
        steps = np.zeros(len(self.fell), dtype=np.int64)
        steps[: len(self.motions)] = [len(each.angles) - 1 for each in self.motions]
        return steps

    def padded(self, steps: int) -> Array:
        """Joint angles and speeds up to so many `steps` (2 x nsteps + 1 x npush x njoint), zeros where none are."""
        padded = np.zeros((2, steps + 1, len(self.fell), self.motions[0].angles.shape[1]))
        for push, each in enumerate(self.motions):
            padded[:, : len(each.angles), push] = each.angles, each.speeds
        return padded


@dataclass(frozen=True, eq=False)
class Record:
    """What an episode showed, of each push; of pushes that were never begun there is nothing.

    Attributes:
        timestep: between two torques, in s.
        steps: that were run after each push (npush), up to the fall where it fell.
        fell: which pushes ended in a fall (npush).
        half_periods: crossings of the upright by each joint (npush x njoint) after the first, which is the push itself
            if it moved an upright joint; of an arm they are not counted.
        crossing_span: time from the first to the last crossing (npush x njoint), interpolated between steps, in s.
        speed_energy: ∫ q̇² dt of each joint (npush x njoint), in rad²/s; of an arm ∫ q̇ᵀ M̄ q̇ dt (npush), in J s, M̄ being
            the nominal mass matrix.
        acceleration_energy: the same of q̈ + k q in rad²/s³, k being the episode's stiffness; of an arm of
            q̈ + k (q − q₀), in J/s.
        angles: joint angles (nsteps + 1 x njoint), in rad, of each push that was begun, if the episode keeps them.
        noise_floor: ∫ q̈² dt of a plant at rest, of all pushes and joints, in rad²/s³.
        windows: the motion up to each of the episode's window ends, as the sensors saw it.
        readings: what the sensors read, if the episode keeps it.
    """

    timestep: float
    steps: NDArray[np.int64]
    fell: NDArray[np.bool_]
    half_periods: NDArray[np.int64]
    crossing_span: Array
    speed_energy: Array
    acceleration_energy: Array
    angles: tuple[Array, ...] = ()
    noise_floor: float = 0.0
    windows: Windows | None = None
    readings: SensorReadings | None = None

    @property
    def total_steps(self) -> int:
        """That were run after all pushes."""
        return int(self.steps.sum())

    @property
    def fall_step(self) -> int | None:
        """How many steps were run where a push fell; else None."""
        return self.total_steps if self.fell.any() else None

    def first(self, pushes: int) -> Record:
        """What the first `pushes` showed, as if the episode had these alone; windows and readings keep their shape."""
        of_pushes = ("steps", "fell", "half_periods", "crossing_span", "speed_energy", "acceleration_energy", "angles")
        return replace(
            self,
            **{name: getattr(self, name)[:pushes] for name in of_pushes},
            noise_floor=self.noise_floor * pushes / len(self.steps),
            windows=None if self.windows is None else self.windows.first(pushes),
            readings=None if self.readings is None else self.readings.first(pushes),
        )

    def stopped_early(self, goes_on: GoesOn | None) -> Record:
        """The record of a whole episode as it would be if `goes_on`, asked after each push but the last and from the
        first fall on, had ended it.
        """
        if goes_on is None:
            return self
        for pushes in range(1, len(self.steps)):
            so_far = self.first(pushes)
            if so_far.fell.any():
                break
            if not goes_on(so_far):
                return so_far
        return self


GoesOn = Callable[[Record], bool]  # whether an episode goes on after a push, given what it has shown so far


def crossings(
    angles: Array, crosses: NDArray[np.bool_], timestep: float, deadband: float = 0.0
) -> tuple[NDArray[np.int64], Array]:
    """Half periods and the time they took, from crossings of the upright.

    A crossing lies between the steps about it, on the straight line.

    Args:
        angles: of joints (nsteps + 1 x ...), in rad.
        crosses: whether the push itself is the first crossing of a joint (...): it moved one that was upright.
        timestep: in s.
        deadband: in rad; angles within it are left out.

    Returns:
        Half periods up to each step (nsteps + 1 x ...), and the time from the first to the last crossing (...), in s.
    """
    steps, moving = np.arange(len(angles)).reshape(-1, *[1] * crosses.ndim), np.abs(angles) > deadband
    last = np.maximum.accumulate(np.where(moving, steps, -1))  # step at which the joint was beyond the deadband
    before = np.concatenate([np.full_like(last[:1], -1), last[:-1]])
    earlier = np.take_along_axis(angles, before, 0)
    crossed = moving & (before >= 0) & (np.sign(angles) != np.sign(earlier))
    step, *joint = np.nonzero(crossed)
    fraction = angles[crossed] / (angles[crossed] - earlier[crossed])
    times = timestep * (step - fraction * (step - before[crossed]))
    begin, end = np.where(crosses, 0.0, np.inf), np.where(crosses, 0.0, -np.inf)
    np.minimum.at(begin, tuple(joint), times)
    np.maximum.at(end, tuple(joint), times)
    crossed[0] = crosses
    return np.maximum(np.cumsum(crossed, axis=0) - 1, 0), np.maximum(end - begin, 0.0)


def energies(speeds: Array, timestep: float, wanted: Array | float = 0.0) -> Array:
    """∫ q̇² dt (trapezoid) and ∫ (q̈ − wanted)² dt (finite differences) up to each step (2 x nsteps + 1 x ...) of joint
    `speeds` (nsteps + 1 x ...), in rad/s.  Eqs. 11 and 14.

    `wanted` (nsteps x ...): the acceleration that the law is to bring about at the beginning of each step, in rad/s².
    The torque of a step is that of its beginning, so with an exact law nothing is left, however long the step.
    """
    squared, jumps = speeds**2, np.diff(speeds, axis=0) - timestep * wanted
    shown = np.zeros((2, *speeds.shape))
    shown[0, 1:] = 0.5 * timestep * np.cumsum(squared[:-1] + squared[1:], axis=0)
    shown[1, 1:] = np.cumsum(jumps**2, axis=0) / timestep
    return shown


def windows_of(
    seen: Seen, ends: Sequence[int], motion: Sequence[Array], half_periods: NDArray[np.int64]
) -> Windows | None:
    """The windows of an episode that was seen step by step; None where it asks for none.

    Args:
        seen: what was.
        ends: the steps (nwindow) at which windows end.
        motion: what `Windows` has of it, up to each step (4 of nsteps + 1 x npush x njoint).
        half_periods: up to each step (nsteps + 1 x npush x njoint).
    """
    if not len(ends):
        return None
    at = np.array(ends)
    shown = np.array([each[at] for each in motion]).transpose(2, 1, 0, 3)
    return windows_before_fall(at, shown, half_periods[at].swapaxes(0, 1), seen.steps, seen.fell)


def same_record(one: Record, other: Record) -> bool:
    """Whether two loops saw the same, but for rounding."""
    (counts, amounts), (other_counts, other_amounts) = _parts(one), _parts(other)
    return all(np.array_equal(mine, theirs) for mine, theirs in zip(counts, other_counts, strict=True)) and all(
        np.allclose(mine, theirs, ALIKE, ALIKE * np.abs(size).max(initial=0.0))
        for (mine, size), (theirs, _) in zip(amounts, other_amounts, strict=True)
    )


def _parts(record: Record) -> tuple[list[NDArray[Any]], list[tuple[Array, Array]]]:
    """What is counted in a record, and what is measured, each with what tells the size of its rounding: what
    accelerates a plant that coasts is nothing else, and no two loops round alike.
    """
    counts: list[NDArray[Any]] = [record.steps, record.fell, record.half_periods]
    amounts = [(energy, record.speed_energy) for energy in (record.speed_energy, record.acceleration_energy)]
    if (seen := record.windows) is not None:
        counts += [seen.seen, seen.half_periods]
        amounts += [(seen.angles, seen.angles), (seen.speeds, seen.speeds)]
        amounts += [(energy, seen.speed_energy) for energy in (seen.speed_energy, seen.acceleration_energy)]
    if record.readings is not None:
        amounts.append((record.readings.angles, record.readings.angles))
    return counts, amounts
