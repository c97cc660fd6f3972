"""What one trial showed of its motion, and the law that it was sent; and the same beside what a twin shows of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.episode import Windows
from metaid.models import Array

PRESLIDING = 1e-3  # rad or m, over which dry friction builds up where nothing else is known of it
# The share of dry friction with which a joint begins, against its speed, and the standard deviation of it: a joint that
# was brought to its speed begins with 1, one that is struck with less, one at rest with any.
BUILT_UP = 0.5


@dataclass(frozen=True, eq=False)
class WatchedTrial:
    """A trial on a plant without noise.

    Attributes:
        law: that was sent: the candidate's lumps, of which `inertia` is used only where there is a `stiffness`; of an
            arm its parameters (njoint x 13).
        timestep: between two torques, in s.
        starts: joint coordinates and speeds (npush x 2 x njoint) right after each push, in rad or m and s.
        windows: what was seen.
        stiffness: k of the law on each push (npush), or the same on all, as of a chain, in 1/s²; 0 where the plant
            coasts at the truth.
    """

    law: Any
    timestep: float
    starts: Array
    windows: Windows
    stiffness: Array | float = 0.0

    is_continuous: ClassVar[bool] = False  # it moves in steps of Euler's

    @property
    def ends(self) -> NDArray[np.int64]:
        """The steps (nwindow) at which windows end."""
        return self.windows.ends

    @property
    def start_speeds(self) -> Array:
        """Of the joints (npush x njoint) right after each push."""
        return self.starts[:, 1]

    def seen(self, windows: int) -> NDArray[np.bool_]:
        """Which of the first `windows` windows of each push were seen (npush x nwindow)."""
        return np.arange(min(windows, len(self.ends))) < self.windows.seen[:, None]

    def thinned(self, every: int) -> WatchedTrial:
        """The same with the first of `every` so many pushes."""
        if every == 1:
            return self
        stiffness = self.stiffness[::every] if isinstance(self.stiffness, np.ndarray) else self.stiffness
        return replace(
            self, starts=self.starts[::every].copy(), windows=self.windows.thinned(every), stiffness=stiffness
        )


def upright(start_speeds: Array) -> Array:
    """The `starts` of a trial on a chain that pushes give these joint speeds (npush x njoint), in rad/s."""
    return np.stack([np.zeros_like(start_speeds), start_speeds], axis=1)


@dataclass(frozen=True)
class ReadTrial:
    """What the sensors of a noisy plant read in one trial, and what it was sent.

    Attributes:
        timestep: in which the plant moves, in s.
        readings: joint angles (npush x nstep + 1 x njoint), in rad or m, the one right after the push first.
        torques: as they were commanded (npush x nstep x njoint), in N m.
        steps: how many steps (npush) of each push were seen before a fall.
        starts: joint coordinates and speeds (npush x 2 x njoint) that such pushes gave in a calibration, in rad or m
            and s.
        start_spread: what pushes differ by, a root of the covariance of the start speeds (npush x njoint x njoint), in
            rad/s, or of coordinates and speeds (npush x 2 njoint x 2 njoint): any L with covariance L Lᵀ. Where the
            plant moves continuously also of the shares with which dry friction begins, behind these. None where they
            are all alike.
        noise: standard deviation of a reading of each joint (njoint), in rad, from the plant at rest.
        substeps: how many timesteps there are between two readings, and between two torques.
        is_continuous: whether the plant moves continuously, as a real one does, and not by such steps of Euler's.
        times: since the push, in s, of each reading (npush x nstep + 1), where the plant tells it; None where ticks are
            taken to keep time.
    """

    timestep: float
    readings: Array
    torques: Array
    steps: NDArray[np.int64]
    starts: Array
    start_spread: Array | None
    noise: Array
    substeps: int = 1
    is_continuous: bool = False
    times: Array | None = None

    law: ClassVar[None] = None  # what was commanded is known

    @property
    def start_speeds(self) -> Array:
        """Of the joints (npush x njoint) right after such pushes."""
        return self.starts[:, 1]

    @property
    def period(self) -> float:
        """Between two readings, and between two torques, in s."""
        return self.timestep * self.substeps

    @cached_property
    def timesteps(self) -> Array:
        """What each step is made of (npush x nstep), in s."""
        npush, nstep, _ = self.torques.shape
        if self.times is None:
            return np.full((npush, nstep), self.timestep)
        seen = np.arange(nstep) < self.steps[:, None]
        return np.where(seen, np.diff(self.times[:, : nstep + 1], axis=1) / self.substeps, self.timestep)

    def only(self, pushes: NDArray[np.intp]) -> ReadTrial:
        """The same with these `pushes` alone."""
        of_pushes = ("readings", "torques", "steps", "starts", "start_spread", "times")
        known = {name: getattr(self, name) for name in of_pushes if getattr(self, name) is not None}
        own: dict[str, Any] = {name: each[pushes] for name, each in known.items()}
        return replace(self, **own)

    def thinned(self, every: int) -> ReadTrial:
        """The same with one reading in so many, and the mean of the torques between."""
        npush, nstep, n = self.torques.shape
        count = nstep // every
        torques, read = self.torques[:, : count * every], slice(0, count * every + 1, every)
        return replace(
            self,
            timestep=every * self.timestep,
            readings=self.readings[:, read].copy(),
            torques=torques.reshape(npush, count, every, n).mean(axis=2),
            steps=self.steps // every,
            times=None if self.times is None else self.times[:, read].copy(),
        )

    @property
    def extras(self) -> int:
        """How many start speeds, and coordinates, are unknown."""
        return 0 if self.start_spread is None else len(self.start_spread) * self.start_spread.shape[-1]


def started(trial: ReadTrial, whitened: Array, is_moved: bool = True) -> Array:
    """Joint coordinates and speeds at the start of each push (npush x 2 x njoint), and where the plant moves
    continuously the shares with which dry friction begins (npush x 3 x njoint): those it was to have and, where it
    `is_moved`, L u, u being `whitened` (npush x nextra).
    """
    shares = [BUILT_UP * np.sign(trial.start_speeds)] if trial.is_continuous else []
    starts = np.stack([*trial.starts.swapaxes(0, 1), *shares], axis=1)
    if trial.start_spread is None or not is_moved:
        return starts
    moved = np.einsum("pij,pj->pi", trial.start_spread, whitened)
    flat = starts.reshape(len(starts), -1)
    flat[:, flat.shape[1] - moved.shape[1] :] += moved
    return flat.reshape(starts.shape)


class Further(NamedTuple):
    """What is unknown beside a robot's parameters: `torques` (npush x nstep x njoint x ntorque), in N m or N, that act
    for one of each of the first; and what `joints` have for one of each of the others, the first axis; None for none.
    """

    torques: Array
    joints: Joints | None

    @property
    def size(self) -> int:
        """How many unknowns these are."""
        return int(self.torques.shape[-1]) + (0 if self.joints is None else len(self.joints.viscous))

    def torques_of(self, push: int, njoint: int) -> Array:
        """Those of one push (nstep x njoint x ntorque), in the order of C: for another, loops are compiled anew."""
        return np.ascontiguousarray(self.torques[push]) if self.torques.size else np.empty((0, njoint, 0))


NOTHING_FURTHER = Further(np.empty((0, 0, 0, 0)), None)


class Coefficients(NamedTuple):
    """Of the twin's angles in polynomials: `values` (npush x njoint x ncoefficient), in rad or m, and their `slopes`
    (npush x njoint x ncoefficient x nunknown, and more by what is further unknown, and of the starts).
    """

    values: Array
    slopes: Array


class Joints(NamedTuple):
    """What the joints of a robot have that its parameters do not say.

    `viscous` in N m s, `dry` in N m and `spring` in N m/rad (njoint each): friction, and the stiffness of a spring that
    is at rest where the joint is straight. `offset` (njoint), in rad: what an encoder reads there. `tilt`, in rad: of
    the base, one angle in the plane of a chain, two of an arm about horizontal axes. `rotor` (njoint), in kg m²: the
    reflected inertia of what turns with a joint, from the second on. `presliding` (1), in rad: over which dry friction
    builds up where the plant moves continuously. `cogging` (3 x njoint): amplitudes of the cosine and of the sine, in
    N m, and how many times a turn it repeats, 0 where there is none.
    """

    viscous: Array
    dry: Array
    spring: Array
    offset: Array
    tilt: Array
    rotor: Array
    presliding: Array
    cogging: Array


@dataclass(frozen=True)
class Replay:
    """A trial as the plant showed it, and as the twin at an estimate moves under the same law.

    Attributes:
        times: since the push (ntime), in s.
        seen: joint angles of the plant (npush x ntime x njoint), in rad, of slides in m; NaN where none was kept.
        simulated: of the twin (npush x ntime x njoint); NaN after what was seen of a push.
        noise: standard deviation of an angle that is seen (njoint).
        joints: their names (njoint).
    """

    times: Array
    seen: Array
    simulated: Array
    noise: Array
    joints: tuple[str, ...]
