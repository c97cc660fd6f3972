"""What an episode showed: sums and crossings of each joint's motion after each push."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from metaid.episode.episode import Episode
from metaid.episode.readings import SensorReadings
from metaid.episode.windows import QUANTITIES, Windows, windows_seen
from metaid.models import Array
from metaid.plant import Start


@dataclass(frozen=True)
class Record:
    """What an episode showed, per push and joint (npush x njoint); rows after a fall are not filled in.

    `half_periods`: crossings of the upright after the first, which is the push itself if it moved an upright joint.
    `crossing_span`: time from the first to the last crossing, interpolated between steps, in s.
    `speed_energy`, `acceleration_energy`: ∫ q̇² dt in rad²/s and ∫ (q̈ + k q)² dt in rad²/s³, k the episode's stiffness.
    `steps`: steps that were run; `fall_step`: the step by which a link had fallen, or None.
    `angles`: joint angles (nsteps + 1 x njoint), in rad, of each push that was begun, if the episode keeps them.
    `noise_floor`: ∫ q̈² dt of a plant at rest, of all pushes and joints, in rad²/s³.
    `windows`: the motion up to each of the episode's window ends.
    `readings`: what the sensors read, if the episode keeps it.
    """

    timestep: float
    steps: int
    fall_step: int | None
    half_periods: NDArray[np.int64]
    crossing_span: Array
    speed_energy: Array
    acceleration_energy: Array
    angles: tuple[Array, ...] = ()
    noise_floor: float = 0.0
    windows: Windows | None = None
    readings: SensorReadings | None = None


GoesOn = Callable[[Record], bool]  # whether an episode goes on after a push, given what it has shown so far


def stopped(record: Record, episode: Episode, pushes: int) -> Record:
    """What an episode has shown after so many whole `pushes`, as if it had these alone; windows and readings keep their
    shape.

    Args:
        record: of the whole episode, or of these pushes and rows that are not filled in.
        episode: what was to be done.
        pushes: how many, none of which ended in a fall.
    """
    return replace(
        record,
        steps=pushes * episode.steps,
        fall_step=None,
        half_periods=record.half_periods[:pushes],
        crossing_span=record.crossing_span[:pushes],
        speed_energy=record.speed_energy[:pushes],
        acceleration_energy=record.acceleration_energy[:pushes],
        angles=record.angles[:pushes],
        noise_floor=record.noise_floor * pushes / len(episode.pushes),
        windows=None if record.windows is None else record.windows.first(pushes),
        readings=None if record.readings is None else record.readings.first(pushes),
    )


def stopped_early(record: Record, episode: Episode, goes_on: GoesOn | None) -> Record:
    """The `record` of a whole episode as it would be if `goes_on`, asked after each push but the last and the one that
    ended in a fall, had ended it.
    """
    if goes_on is None:
        return record
    for pushes in range(1, (record.steps - 1) // episode.steps + 1):
        so_far = stopped(record, episode, pushes)
        if not goes_on(so_far):
            return so_far
    return record


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
    rad/s.  Eqs. 10 and 17.

    `wanted` (nsteps x njoint): the acceleration that the law is to bring about at the beginning of each step, in
    rad/s². The torque of a step is that of its beginning, so with an exact law nothing is left, however long the step.
    """
    squared = speeds**2
    speed_energy = timestep * (squared.sum(axis=0) - 0.5 * (squared[0] + squared[-1]))
    acceleration_energy = ((np.diff(speeds, axis=0) - timestep * wanted) ** 2).sum(axis=0) / timestep
    return speed_energy, acceleration_energy


def windows_of(motions: Sequence[tuple[Array, Array]], episode: Episode, timestep: float, fell: bool) -> Windows | None:
    """The windows of an episode whose motion is known step by step; None where it asks for none.

    Args:
        motions: joint angles and speeds (nsteps + 1 x njoint) of each push that was begun, in rad and rad/s.
        episode: what was done.
        timestep: between two control steps, in s.
        fell: whether the last push that was begun ended in a fall.
    """
    if not episode.window_ends:
        return None
    ends, (npush, njoint) = np.array(episode.window_ends), episode.pushes.shape
    seen = windows_seen(ends, [len(angles) - 1 for angles, _ in motions], fell, npush)
    motion = np.zeros((npush, len(ends), QUANTITIES, njoint))
    half_periods = np.zeros((npush, len(ends), njoint), dtype=np.int64)
    for push, ((angles, speeds), start) in enumerate(zip(motions, episode.starts, strict=False)):
        crosses = crosses_at(start, speeds[0])
        for window, end in enumerate(ends[: seen[push]]):
            shown = energies(speeds[: end + 1], timestep, -episode.stiffness * angles[:end])
            motion[push, window] = angles[end], speeds[end], *shown
            half_periods[push, window], _ = crossings(angles[: end + 1], crosses, timestep, episode.deadband)
    return Windows(ends, seen, motion, half_periods)


def same_record(one: Record, other: Record) -> bool:
    """Whether two loops saw the same, but for rounding."""
    return (
        one.fall_step == other.fall_step
        and bool((one.half_periods == other.half_periods).all())
        and _same(one.speed_energy, other.speed_energy)
        and _same(one.acceleration_energy, other.acceleration_energy)
        and _same_windows(one.windows, other.windows)
    )


def _same_windows(one: Windows | None, other: Windows | None) -> bool:
    if one is None or other is None:
        return one is other
    counts = (one.seen == other.seen).all() and (one.half_periods == other.half_periods).all()
    return bool(counts) and _same(one.motion, other.motion)


def _same(one: Array, other: Array) -> bool:
    return bool(np.allclose(one, other, rtol=1e-6, atol=1e-9))
