"""The twin of an arm, and one beside it along each unknown: its derivatives are differences."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import Run
from metaid.compiled.spatial import (
    EULER,
    MIDPOINT,
    RUNGE_KUTTA,
    DrivenPushes,
    Followed,
    Frames,
    Times,
    follow_laws,
    follow_readings,
    follow_torques,
    lead_arm,
)
from metaid.estimation.base_unknowns import BaseUnknowns
from metaid.estimation.trials import (
    NOTHING_FURTHER,
    PRESLIDING,
    Coefficients,
    Driven,
    Filtered,
    Gains,
    Joints,
    ReadTrial,
    WatchedTrial,
)
from metaid.estimation.twin import Filter, Motion
from metaid.models import Array
from metaid.models.tree import PARAMETERS, tilted_gravity

DAMPING, COULOMB = PARAMETERS.index("damping"), PARAMETERS.index("coulomb")
# A longer step of an unknown is more often past where a joint begins to stick, a shorter one leaves rounding.
# Differences to one side cost half of those to both. What they are wrong by, a STEP's share of the curvature, is less
# than a step of the descent needs to be right by.
STEP = 1e-7
BESIDE = 1e-6  # the same of what is unknown beside the parameters; of a torque, as a share of the largest commanded
TINY = 1e-12  # no torque, in N m


@dataclass(frozen=True)
class Beside:
    """A twin, and one beside it along each unknown.

    Attributes:
        frames: of the arm, as it stands.
        candidates: parameters of the twins (ncandidate x njoint x 13).
        starts: true joint coordinates and speeds at the starts (ncandidate x npush x 2 x njoint).
        by_angle: what acts by the coordinate of a joint (5 x njoint): springs, cogging, and dry friction where it
            builds up.
        offset: what encoders read at 0 (njoint), in rad or m.
    """

    frames: Frames
    candidates: Array
    starts: Array
    by_angle: Array
    offset: Array

    @property
    def first(self) -> Beside:
        """The twin alone."""
        return replace(self, candidates=self.candidates[:1], starts=self.starts[:1])

    def follow(self, driven: Driven, times: Times, led: Gains | None) -> Followed:
        """What all of them show in a trial, led by its readings where there are gains."""
        trial, _, steps, basis, _ = driven
        if led is None:
            seen = basis, np.arange(len(steps)), steps
            return follow_torques(self.frames, self.candidates, self.starts, trial.torques, seen, times, self.by_angle)
        read = trial.readings - self.offset
        pushes = DrivenPushes(self.frames, self.starts, trial.torques, read, steps, self.by_angle, times)
        return follow_readings(pushes, self.candidates, (led.gains, led.weights), np.ascontiguousarray(basis))


@dataclass(frozen=True, eq=False)
class SpatialTwin:
    """An arm at a `point` (nunknown); see `twin.Twin`."""

    unknowns: BaseUnknowns
    point: Array

    @cached_property
    def _candidates(self) -> Array:
        """Parameters of the twin and of those beside it (1 + nunknown x njoint x 13)."""
        beside = self.point + STEP * np.eye(len(self.point))
        return self.unknowns.parameters(np.vstack([self.point, beside]))

    def watch(self, trial: WatchedTrial, windows: int, energies: bool = False) -> Motion:
        if energies:
            raise ValueError("the twin of an arm shows no energies")
        wanted = np.minimum(trial.windows.seen, windows)
        found = self._follow(trial, trial.ends[:windows], wanted, self._candidates)
        slopes = np.moveaxis((found.values[1:] - found.values[0]) / STEP, 0, -1)
        reached = np.where(found.arrived.all(axis=0), wanted, 0)
        none, no_slopes = np.empty((0, 0, 0)), np.empty((0, 0, 0, 0))
        return Motion(found.values[0], slopes, none, none, no_slopes, no_slopes, reached)

    def trace(self, trial: WatchedTrial, steps: NDArray[np.int64]) -> tuple[Array, NDArray[np.bool_]]:
        every = np.arange(1, steps[-1] + 1)
        twin = self._follow(trial, every, trial.last, self._candidates[:1])
        # Steps are Euler's, so the speeds after each are all that there is to know of where the twin is.
        angles = trial.starts[:, 0, None] + trial.timestep * np.cumsum(twin.values[0], axis=1)
        return angles[:, steps - 1], (steps <= trial.last[:, None]) & twin.arrived[0][:, None]

    def _follow(
        self, trial: WatchedTrial, ends: NDArray[np.int64], wanted: NDArray[np.int64], candidates: Array
    ) -> Followed:
        """Twins under the law of a trial, to the `wanted` (npush) of the `ends` of windows, in steps."""
        stiffness = np.full(len(trial.starts), trial.stiffness)
        windows, frames = (np.ascontiguousarray(ends), wanted), self.unknowns.frames
        return follow_laws(frames, trial.law, candidates, (trial.starts, stiffness), windows, trial.timestep)

    def drive(self, driven: Driven, joints: Joints | None, led: Gains | None = None) -> Coefficients | None:
        trial, _, steps, basis, further = driven
        beside, times = self._beside(driven, joints), _times(trial)
        rough = times._replace(order=min(times.order, MIDPOINT))  # in half of the time
        is_apart = times != rough and len(beside.candidates) + further.size > 1
        followed = beside.follow(driven, rough if is_apart else times, led)
        own = beside.first.follow(driven, times, led) if is_apart else followed
        if not (followed.arrived & own.arrived)[:, steps > 0].all():
            return None
        shown, count = followed.values.swapaxes(2, 3), len(self.point)
        slopes = np.moveaxis((shown[1:] - shown[0]) / STEP, 0, -1)
        if further.size:
            moved = self._moved(driven, joints, rough, led, shown[0])
            if moved is None:
                return None
            slopes = np.concatenate([slopes[..., :count], moved, slopes[..., count:]], axis=-1)
        slopes = np.ascontiguousarray(slopes)
        if count and self.unknowns.is_level:
            # Differences have rounding where nothing moves, which on exact sensors would pass for knowledge.
            slopes[..., count - self.unknowns.prior.hidden_level : count] = 0.0
        values = np.where((steps > 0)[:, None, None], own.values[0].swapaxes(1, 2), 0.0)
        if led is None:
            values += np.where(steps[:, None] > 0, basis.sum(axis=1), 0.0)[:, None] * beside.offset[:, None]
        return Coefficients(values, slopes)

    def _moved(
        self, driven: Driven, joints: Joints | None, times: Times, led: Gains | None, shown: Array
    ) -> Array | None:
        """What the coefficients that are `shown` (npush x njoint x ncoefficient) change by with what is further unknown
        (npush x njoint x ncoefficient x nfurther); None where a twin does not arrive.
        """
        slopes, alone = np.zeros((*shown.shape, driven.further.size)), SpatialTwin(self._alone, np.empty(0))
        for column, (beside, own, step) in enumerate(_each_beside(driven, joints)):
            found = alone._beside(beside, own).follow(beside, times, led)
            if not found.arrived[:, driven.steps > 0].all():
                return None
            slopes[..., column] = (found.values[0].swapaxes(1, 2) - shown) / step
        if led is None and driven.further.joints is not None:  # coefficients of what encoders read
            first, seen = driven.further.size - len(driven.further.joints.offset), driven.steps[:, None] > 0
            read = np.where(seen, driven.basis.sum(axis=1), 0.0)
            slopes[..., first:] += np.einsum("pk,cj->pjkc", read, driven.further.joints.offset)
        return slopes

    @cached_property
    def _alone(self) -> BaseUnknowns:
        """The same arm, of which nothing is unknown."""
        return self.unknowns.alone(self.point)

    def lead(self, filtered: Filtered, joints: Joints | None) -> Filter:
        trial, starts, begins, pushes = filtered
        alike = Driven(replace(trial, start_spread=None), starts, trial.steps, np.zeros((len(starts), 1, 1)))
        beside = SpatialTwin(self._alone, np.empty(0))._beside(alike, joints)
        read = np.ascontiguousarray(trial.readings - beside.offset)
        settings = trial.steps, beside.by_angle, _times(trial)
        driven = DrivenPushes(beside.frames, beside.starts[0], trial.torques, read, *settings)
        begins, offset = np.ascontiguousarray(begins), np.append(beside.offset, np.zeros_like(beside.offset))

        def run(noise: tuple[Array, Array], is_kept: bool) -> Run:
            return lead_arm(driven, beside.candidates[0], begins, noise, pushes, is_kept)

        forces, of_reading = np.eye(len(beside.offset)), np.diag(trial.noise**2)
        return Filter(run, of_reading, forces, begins, trial.steps, pushes, lambda states: states + offset)

    def _beside(self, driven: Driven, joints: Joints | None) -> Beside:
        """The twin of a trial and those beside it, with what the `joints` have besides; None for nothing."""
        trial, states = driven.trial, driven.starts
        n = states.shape[2]
        # A start of one push has no influence on another, so those of all pushes are changed at once.
        extra = 0 if trial.start_spread is None else trial.start_spread.shape[-1]
        further = STEP * np.eye(extra, 2 * n, 2 * n - extra)
        moved = np.concatenate([np.zeros((1 + len(self.point), 2 * n)), further]).reshape(-1, 1, 2, n)
        candidates = np.concatenate([self._candidates, np.repeat(self._candidates[:1], extra, axis=0)])
        frames, by_angle, offset = self.unknowns.frames, np.zeros((5, n)), np.zeros(n)
        presliding = PRESLIDING if joints is None else float(joints.presliding[0])
        if joints is not None:
            candidates[..., DAMPING] += joints.viscous
            candidates[..., COULOMB] += joints.dry
            frames = frames._replace(gravity=tilted_gravity(frames.gravity, joints.tilt))
            by_angle[:4], offset = np.vstack([joints.spring, joints.cogging]), joints.offset
        by_angle[4] = presliding if trial.is_continuous else 0.0
        starts = np.ascontiguousarray(states + moved)
        starts[:, :, 0] -= offset
        return Beside(frames, candidates, starts, by_angle, offset)


def _each_beside(driven: Driven, joints: Joints | None) -> Iterator[tuple[Driven, Joints | None, float]]:
    """What is `driven` with a little of each that is further unknown, with what the `joints` have then, and how much of
    it that is.
    """
    trial, further = replace(driven.trial, start_spread=None), driven.further
    largest = float(np.abs(trial.torques).max())
    for torques in further.torques:
        step = BESIDE * largest / max(float(np.abs(torques).max()), TINY)
        more = replace(trial, torques=trial.torques + step * torques)
        yield driven._replace(trial=more, further=NOTHING_FURTHER), joints, step
    if further.joints is not None and joints is not None:
        alike = driven._replace(trial=trial, further=NOTHING_FURTHER)
        for each in zip(*further.joints, strict=True):
            yield alike, Joints(*(own + BESIDE * more for own, more in zip(joints, each, strict=True))), BESIDE


def _times(trial: ReadTrial) -> Times:
    """How the twins of a trial move between two readings."""
    return Times(trial.timesteps, trial.substeps, RUNGE_KUTTA if trial.is_continuous else EULER)
