"""What an episode showed: sums and crossings of each joint's motion after each push."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.episode.pushed import Pushed
from metaid.episode.readings import SensorReadings
from metaid.episode.windows import QUANTITIES, Windows, windows_seen
from metaid.models import Array
from metaid.plant import Start

ALIKE = 1e-9  # relative: how far two loops may differ that take the same steps

Motion = tuple[Array, Array]  # joint angles and speeds (nsteps + 1 x njoint) after a push


@dataclass(frozen=True, eq=False)
class Seen:
    """What was seen of an episode, step by step: the `motions` of pushes that were begun, which of all pushes `fell`
    (npush), and the `timestep` between two torques, in s.
    """

    motions: Sequence[Motion]
    fell: NDArray[np.bool_]
    timestep: float

    @property
    def steps(self) -> NDArray[np.int64]:
        """That were run after each push (npush)."""
        steps = np.zeros(len(self.fell), dtype=np.int64)
        steps[: len(self.motions)] = [len(angles) - 1 for angles, _ in self.motions]
        return steps


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
        return replace(
            self,
            steps=self.steps[:pushes],
            fell=self.fell[:pushes],
            half_periods=self.half_periods[:pushes],
            crossing_span=self.crossing_span[:pushes],
            speed_energy=self.speed_energy[:pushes],
            acceleration_energy=self.acceleration_energy[:pushes],
            angles=self.angles[:pushes],
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


@dataclass(frozen=True)
class Trajectory:
    """Joint `angles` in rad and `speeds` in rad/s of the last push, (nsteps + 1 x njoint), the state right after the
    push first.
    """

    angles: Array
    speeds: Array


def crossings(
    angles: Array, crosses: NDArray[np.bool_], timestep: float, deadband: float = 0.0
) -> tuple[NDArray[np.int64], Array]:
    """Half periods and the time they took, from crossings of the upright.

    A crossing lies between the steps about it, on the straight line.

    Args:
        angles: of the joints (nsteps + 1 x njoint), in rad.
        crosses: whether the push itself is the first crossing of a joint (njoint): it moved one that was upright.
        timestep: in s.
        deadband: in rad; angles within it are left out.

    Returns:
        Half periods (njoint) and the time from the first to the last crossing (njoint), in s.
    """
    njoint = angles.shape[1]
    half_periods, span = np.zeros(njoint, dtype=np.int64), np.zeros(njoint)
    for joint in range(njoint):
        moving = np.flatnonzero(np.abs(angles[:, joint]) > deadband)
        if len(moving) == 0:
            continue
        angle = angles[moving, joint]
        after = np.flatnonzero(np.sign(angle[1:]) != np.sign(angle[:-1])) + 1
        fraction = angle[after] / (angle[after] - angle[after - 1])
        times = timestep * (moving[after] - fraction * (moving[after] - moving[after - 1]))
        if crosses[joint]:
            times = np.append(0.0, times)
        half_periods[joint] = max(len(times) - 1, 0)
        span[joint] = times[-1] - times[0] if len(times) else 0.0
    return half_periods, span


def crosses_at(start: Start, speeds: Array) -> NDArray[np.bool_]:
    """Whether a push is the first crossing of the upright of a joint (njoint), whose speed after it is in `speeds`
    (njoint), in rad/s.
    """
    crosses: NDArray[np.bool_] = (start.angles == 0.0) & (speeds != 0.0)
    return crosses


def energies(speeds: Array, timestep: float, wanted: Array | float = 0.0) -> tuple[Array, Array]:
    """∫ q̇² dt (trapezoid) and ∫ (q̈ − wanted)² dt (finite differences) per joint of `speeds` (nsteps + 1 x njoint), in
    rad/s.  Eqs. 11 and 14.

    `wanted` (nsteps x njoint): the acceleration that the law is to bring about at the beginning of each step, in
    rad/s². The torque of a step is that of its beginning, so with an exact law nothing is left, however long the step.
    """
    squared = speeds**2
    speed_energy = timestep * (squared.sum(axis=0) - 0.5 * (squared[0] + squared[-1]))
    acceleration_energy = ((np.diff(speeds, axis=0) - timestep * wanted) ** 2).sum(axis=0) / timestep
    return speed_energy, acceleration_energy


def windows_of(seen: Seen, episode: Pushed) -> Windows | None:
    """The windows of an episode of a chain that was seen step by step; None where it asks for none."""
    if not episode.window_ends:
        return None
    ends, (npush, njoint) = np.array(episode.window_ends), episode.pushes.shape
    whole = windows_seen(ends, seen.steps, seen.fell)
    motion = np.zeros((npush, len(ends), QUANTITIES, njoint))
    half_periods = np.zeros((npush, len(ends), njoint), dtype=np.int64)
    for push, ((angles, speeds), start) in enumerate(zip(seen.motions, episode.starts, strict=False)):
        crosses = crosses_at(start, speeds[0])
        for window, end in enumerate(ends[: whole[push]]):
            shown = energies(speeds[: end + 1], seen.timestep, -episode.springs[push] * angles[:end])
            motion[push, window] = angles[end], speeds[end], *shown
            half_periods[push, window], _ = crossings(angles[: end + 1], crosses, seen.timestep, episode.deadband)
    return Windows(ends, whole, motion, half_periods)


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
