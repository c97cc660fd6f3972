"""What a perturb-and-count episode is, what is recorded of it, and the plain loop that runs one on any plant.

An episode is a number of pushes. For each, the plant is brought to rest upright, pushed, and for a fixed number of
steps sent nothing but the torque that a candidate's lumps say would cancel gravity and Coriolis forces. The first
fall ends the whole episode.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.chain import Array, Chain, Lumps, compensation_torque
from metaid.errors import EpisodeError
from metaid.plant import Plant

FALL_LIMIT = np.pi / 2  # rad
RICH_FALL_LIMIT = np.pi  # rad; a link that is pushed to 60° on purpose has not fallen at 90°
FALL_MARGIN = 1.5  # past the limit, a link this many times faster than any was right after the push has fallen
REACH = 1.0  # rad that the fastest link of a rich push coasts through within the horizon: short of the fall limit
TRIAL_IMPULSE = 1.0 / 16.0  # N s, where it is not known yet what a push does; a power of two, so nothing is rounded
SLOWEST_LINK, SLOWEST_JOINT = 0.3, 0.2  # of the peak speed, in a rich push


@dataclass(frozen=True)
class NoiseFloor:
    """What an episode's readings would show of a plant at rest: the `energy` ∫ q̈² dt of all pushes and joints, in
    rad²/s³; the `frequency` that it looks like, in Hz; and the root of the standard deviation of its square, `spread`,
    in Hz.
    """

    energy: float
    frequency: float
    spread: float


SILENT = NoiseFloor(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Episode:
    """`pushes` (npush x njoint), horizontal impulses at the link tips in N s; `steps` after each; when a link counts
    as fallen; whether the record keeps the joint angles.

    A `fall_margin` of 0 means that a link past the limit has fallen however slow it is. With a `stiffness` k, in 1/s²,
    the law also asks for q̈ = −k q, so that the plant swings where it would coast (Eq. 16). For a plant with faults: a
    joint within `deadband` (rad) of the upright is on neither side of it; `seed` is of the noise, and `noise_floor` how
    much of it there is. The law is told the angles that the speeds lead to after `lead` seconds, for a plant whose
    torques come late.
    """

    pushes: Array
    steps: int
    fall_limit: float = FALL_LIMIT
    fall_margin: float = FALL_MARGIN
    keep_angles: bool = False
    stiffness: float = 0.0
    deadband: float = 0.0
    seed: int = 0
    noise_floor: NoiseFloor = SILENT
    lead: float = 0.0

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise EpisodeError(f"steps is {self.steps} (allowed: 1 or more)")
        if not np.isfinite(self.pushes).all() or not np.any(self.pushes, axis=1).all():
            raise EpisodeError(
                "every push needs a finite impulse, in N s, on at least one link: without a push nothing moves"
            )

    @property
    def total_steps(self) -> int:
        return self.steps * len(self.pushes)


@dataclass(frozen=True)
class Record:
    """What an episode showed, per push and joint (npush x njoint); rows after a fall are not filled in.

    `half_periods`: crossings of the upright after the first, the push itself being the first if it moved that joint.
    `crossing_span`: time from the first to the last crossing, interpolated between steps, in s.
    `speed_energy`, `acceleration_energy`: ∫ q̇² dt in rad²/s and ∫ (q̈ + k q)² dt in rad²/s³, k the episode's stiffness.
    `steps`: steps that were run; `fall_step`: the step by which a link had fallen, or None.
    `angles`: joint angles (nsteps + 1 x njoint), in rad, of each push that was begun, if the episode keeps them.
    `noise_floor`: ∫ q̈² dt of a plant at rest, of all pushes and joints, in rad²/s³.
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


@dataclass(frozen=True)
class Trajectory:
    """Joint `angles` in rad and `speeds` in rad/s of the last push, (nsteps + 1 x njoint), the state right after the
    push first.
    """

    angles: Array
    speeds: Array


def has_fallen(angles: Array, speeds: Array, limit: float, fastest: float) -> bool:
    """Whether any link is past `limit` (rad) and faster than `fastest` (rad/s), or not finite: falling is not
    coasting.  Eq. 8.

    Absolute `angles` (nlink) and `speeds` (nlink). Written so that NaN counts as fallen.
    """
    inside = (np.abs(angles) <= limit) | (np.abs(speeds) <= fastest)
    return not bool(np.all(inside & np.isfinite(angles)))


def run_plain(plant: Plant, candidate: Lumps, episode: Episode) -> tuple[Record, Trajectory]:
    """One episode on any plant, step by step: the reference for the compiled loop, and what a rig uses."""
    shape = episode.pushes.shape
    half_periods, span = np.zeros(shape, dtype=np.int64), np.zeros(shape)
    speed_energy, acceleration_energy = np.zeros(shape), np.zeros(shape)
    steps, fall_step, kept = 0, None, []
    for push, impulses in enumerate(episode.pushes):
        angles, speeds = _watch_push(plant, candidate, episode, impulses)
        ran = len(angles) - 1
        kept.append(angles)
        half_periods[push], span[push] = crossings(angles, speeds[0], plant.timestep, episode.deadband)
        asked = -episode.stiffness * angles[:-1]
        speed_energy[push], acceleration_energy[push] = energies(speeds, plant.timestep, asked)
        steps += ran
        fastest = episode.fall_margin * np.abs(np.cumsum(speeds[0])).max()
        if has_fallen(np.cumsum(angles[-1]), np.cumsum(speeds[-1]), episode.fall_limit, fastest):
            fall_step = steps
            break
    seen = half_periods, span, speed_energy, acceleration_energy
    kept_angles = tuple(kept) if episode.keep_angles else ()
    record = Record(plant.timestep, steps, fall_step, *seen, kept_angles, episode.noise_floor.energy)
    return record, Trajectory(angles, speeds)


def _watch_push(plant: Plant, candidate: Lumps, episode: Episode, impulses: Array) -> tuple[Array, Array]:
    """Joint angles and speeds (nsteps + 1 x njoint) after a push; however it ends, the torque is off then."""
    try:
        plant.push(impulses)
        angles, speeds = plant.states()
        history = [(angles, speeds)]
        fastest = episode.fall_margin * np.abs(np.cumsum(speeds)).max()
        for _ in range(episode.steps):
            led = angles + episode.lead * speeds
            plant.apply_torque(compensation_torque(candidate, led, speeds, plant.gravity, episode.stiffness))
            plant.step()
            angles, speeds = plant.states()
            history.append((angles, speeds))
            if has_fallen(np.cumsum(angles), np.cumsum(speeds), episode.fall_limit, fastest):
                break
    finally:
        plant.stop()
    return np.array([angles for angles, _ in history]), np.array([speeds for _, speeds in history])


def crossings(
    angles: Array, start_speeds: Array, timestep: float, deadband: float = 0.0
) -> tuple[NDArray[np.int64], Array]:
    """Half periods (njoint) and the time they took (njoint), in s, of joint `angles` (nsteps + 1 x njoint) that start
    upright.

    The push is the first crossing of every joint that it moved. A later one lies between the steps about it, on the
    straight line. Angles within the `deadband` (rad) are left out.
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
        if start_speeds[joint] != 0.0:
            times = np.append(0.0, times)
        half_periods[joint] = max(len(times) - 1, 0)
        span[joint] = times[-1] - times[0] if len(times) else 0.0
    return half_periods, span


def energies(speeds: Array, timestep: float, asked: Array | float = 0.0) -> tuple[Array, Array]:
    """∫ q̇² dt (trapezoid) and ∫ (q̈ − asked)² dt (finite differences) per joint of `speeds` (nsteps + 1 x njoint), in
    rad/s.  Eqs. 10 and 17.

    `asked` (nsteps x njoint): the acceleration that the law asks for at the beginning of each step, in rad/s². The
    torque of a step is that of its beginning, so with an exact law nothing is left, however long the step.
    """
    squared = speeds**2
    speed_energy = timestep * (squared.sum(axis=0) - 0.5 * (squared[0] + squared[-1]))
    acceleration_energy = ((np.diff(speeds, axis=0) - timestep * asked) ** 2).sum(axis=0) / timestep
    return speed_energy, acceleration_energy


def pushed_speeds(plant: Plant, pushes: Array) -> Array:
    """The absolute link speeds (npush x njoint), in rad/s, that are seen right after each of the `pushes` (npush x
    njoint), in N s.
    """
    seen = []
    for impulses in pushes:
        plant.push(impulses)
        seen.append(np.cumsum(plant.states()[1]))
        plant.stop()
    return np.array(seen)


def pushes_for(plant: Plant, speeds: Array) -> Array:
    """The impulses (npush x njoint), in N s, that give the plant these absolute link `speeds` (npush x njoint), in
    rad/s.

    Found as one would on a rig: one trial push at each link, watching the speeds; they are linear in the impulses.
    """
    response = pushed_speeds(plant, TRIAL_IMPULSE * np.eye(plant.njoint)).T / TRIAL_IMPULSE
    impulses: Array = np.asarray(np.linalg.solve(response, speeds.T).T, dtype=np.float64)
    return impulses


def tip_push(plant: Plant, peak_speed: float) -> Array:
    """One push at the tip alone (1 x njoint), in N s, that gives the plant's fastest link `peak_speed`, in rad/s."""
    impulses = TRIAL_IMPULSE * np.eye(plant.njoint)[-1:]
    return impulses * (peak_speed / float(np.abs(pushed_speeds(plant, impulses)).max()))


def rich_speeds(njoint: int, count: int, seed: int) -> Array:
    """Link speeds (count x njoint) as fractions of a peak speed: a random sign and 0.3 to 1 for every link.

    No joint gets less than 0.2 of the peak: one that hardly moves tells little of the lumps about it.
    """
    random = np.random.default_rng(seed)
    speeds = np.zeros((count, njoint))
    for push in range(count):
        below = 0.0
        for link in range(njoint):
            speed = below
            while abs(speed - below) < SLOWEST_JOINT:
                speed = random.uniform(SLOWEST_LINK, 1.0) * random.choice([-1.0, 1.0])
            speeds[push, link] = below = speed
    return speeds


def rich_pushes(plant: Plant, count: int, peak_speed: float, seed: int) -> Array:
    """`count` random pushes (count x njoint), in N s, whose fastest link may get `peak_speed`, in rad/s."""
    return pushes_for(plant, peak_speed * rich_speeds(plant.njoint, count, seed))


def natural_time(chain: Chain, gravity: float) -> float:
    """√(l/g) for the chain's mean link length, in s: what sets every time scale of its motion."""
    return float(np.sqrt(chain.length.mean() / gravity))
