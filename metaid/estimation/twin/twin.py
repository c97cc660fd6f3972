"""The simulated twin of a robot: its compiled loops, push by push, on several threads. Its derivatives are exact."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import Filtered, run_of, share_out, spread_of
from metaid.estimation.trials import NOTHING_FURTHER, Coefficients, Further, Joints, ReadTrial, WatchedTrial
from metaid.estimation.twin.driven import watch_readings
from metaid.estimation.twin.filtered import lead
from metaid.estimation.twin.shown import Filter, Shown, with_energies
from metaid.estimation.twin.watched import watch_push
from metaid.estimation.twin.workspace import Beside, beside, no_joints, workspace
from metaid.models import Array


@dataclass(frozen=True, eq=False)
class Twin(ABC):
    """A robot with some `unknowns`, simulated at a `point` (nunknown). The derivatives of what it shows are by these,
    by what is further unknown of a trial, and by what is of its starts, in this order.

    A kernel moves it in coordinates of its own, joint coordinates by a matrix. What loops are given is in the order of
    C and can be written to: for others numba compiles them anew.
    """

    unknowns: Any
    point: Array

    @property
    @abstractmethod
    def links(self) -> Array:
        """The kernel's coordinates, by those of joints (njoint x njoint)."""

    @property
    @abstractmethod
    def space(self) -> tuple[NDArray[np.int64], Any]:
        """The link below each joint (njoint), -1 for none, and what a thread's kernel works in."""

    @abstractmethod
    def _leaning(self, joints: Joints) -> tuple[Array, Array, Array]:
        """What `joints` have for one of each of some unknowns makes of the kernel's coordinates: how far these are from
        where they are read (nother x njoint), and each from the link below (nother x njoint), in rad; and the tilts of
        a base that turns about axes of its own (naxis x nother), in rad.
        """

    @abstractmethod
    def _moving(self, trial: WatchedTrial | ReadTrial, joints: Joints, unknown: Beside) -> tuple[Any, Any]:
        """As `moving` says, by all that joints have, and what is `unknown` beside the robot."""

    def moving(
        self, trial: WatchedTrial | ReadTrial, joints: Joints | None = None, further: Further = NOTHING_FURTHER
    ) -> tuple[Any, Any]:
        """What it moves by in a trial, under its law if it has one, without springs, and the derivatives of that; with
        what `joints` have beside the parameters, None for nothing, and by what is `further` unknown, of which torques
        are those of the first push.
        """
        n = self.unknowns.njoint
        none = no_joints(n, self.unknowns.tilts)
        more = Joints(*(each[None][:0] for each in none)) if further.joints is None else further.joints
        unknown = beside(further.torques_of(0, n), more, self._leaning(more), len(self.point))
        return self._moving(trial, none if joints is None else joints, unknown)

    def by_unknowns(self, slopes: Array) -> Array:
        """The derivatives by the unknowns (... x nunknown), of those by what the kernel differentiates by."""
        return slopes

    @cached_property
    def alone(self) -> Twin:
        """The same robot, of which nothing is unknown."""
        return type(self)(self.unknowns.alone(self.point), np.empty(0))

    def watch(self, trial: WatchedTrial, windows: int, energies: bool = False) -> Shown:
        """The first so many `windows` of each push of a trial, under the same law; with `energies` and their
        derivatives, where it has them.
        """
        ends, wanted = trial.ends[:windows].copy(), np.minimum(trial.windows.seen, windows)
        if not energies:
            return self.follow(trial, ends, wanted)
        return with_energies(self.follow(trial, np.arange(ends[-1] + 1), np.append(0, ends)[wanted] + 1), trial, ends)

    def follow(self, trial: WatchedTrial, ends: NDArray[np.int64], wanted: NDArray[np.int64]) -> Shown:
        """The motion up to the `wanted` (npush) of the `ends` of windows, in steps, of which the first may be 0."""
        npush, _, n = trial.starts.shape
        nunknown, shape = len(self.point), (npush, len(ends), n)
        angles, speeds, by_angle, by_speed = shown = (*np.zeros((2, *shape)), *np.zeros((2, *shape, nunknown)))
        reached, stiffness = np.zeros(npush, dtype=np.int64), np.broadcast_to(trial.stiffness, npush)
        balance, derivatives = self.moving(trial)

        def run(pushes: Iterator[int]) -> None:
            room = workspace(*self.space, nunknown)
            for push in pushes:
                own, seen = balance._replace(stiffness=float(stiffness[push])), tuple(each[push] for each in shown)
                settings = derivatives, trial.timestep, ends[: wanted[push]], room, seen
                reached[push] = watch_push(trial.starts[push], own, *settings)

        share_out(run, npush, npush * int(ends[-1]) * 2 * n * n * max(nunknown, 1))
        return Shown(angles, speeds, self.by_unknowns(by_angle), self.by_unknowns(by_speed), reached)

    def trace(self, trial: WatchedTrial, steps: NDArray[np.int64]) -> tuple[Array, NDArray[np.bool_]]:
        """Joint coordinates after so many `steps` of each push of a trial (npush x nsteps x njoint), under the same
        law, and whether the push was seen so far and the twin got there (npush x nsteps).
        """
        last = np.append(0, trial.ends)[trial.windows.seen]
        motion = self.alone.follow(trial, steps, (steps <= last[:, None]).sum(axis=1))
        return motion.angles, np.arange(len(steps)) < motion.reached[:, None]

    def drive(
        self,
        trial: ReadTrial,
        starts: Array,
        steps: NDArray[np.int64],
        basis: Sequence[Array] | Array,
        joints: Joints | None,
        further: Further = NOTHING_FURTHER,
        led: Filtered | None = None,
    ) -> Coefficients | None:
        """What it shows of a noisy trial, driven by what was commanded; None where it cannot follow.

        Args:
            trial: with the torques that acted.
            starts: joint coordinates and speeds (npush x 2 x njoint) right after each push, and with which share dry
                friction begins (npush x 3 x njoint); by default with all of it, against the speed.
            steps: how many steps (npush) of each push to follow.
            basis: the polynomials (nstep + 1 x ncoefficient) that each push is seen in.
            joints: what they have beside the parameters; None for nothing.
            further: what is unknown beside the robot.
            led: gains of a filter that sets it right by the readings. The coefficients are then those of the whitened
                innovations.
        """
        basis = [np.ascontiguousarray(each) for each in basis]
        (npush, _, n), coefficients, nunknown = starts.shape, basis[0].shape[1], len(self.point)
        extra = 0 if trial.start_spread is None else trial.start_spread.shape[-1]
        balance, by = self.moving(trial, joints, further)
        idle = n if extra and trial.is_continuous and not balance.dry.any() else 0  # shares of no friction
        if idle:
            starts, extra = np.ascontiguousarray(starts[:, :2]), extra - idle
        own = nunknown + further.size
        columns = own + extra
        values, slopes = np.empty((npush, n, coefficients)), np.empty((npush, n, coefficients, columns))
        followed = np.zeros(npush, dtype=np.bool_)
        settings, forces = (own, extra, trial.substeps, trial.is_continuous), self._forces(trial)
        right = run_of(npush, 0, n, False) if led is None else led  # no reading sets it right
        readings = trial.readings[:, : right.gains.shape[1]] @ self.links.T

        def run(pushes: Iterator[int]) -> None:
            room = workspace(*self.space, columns, is_continuous=trial.is_continuous)
            for push in pushes:
                pushed, moving = (starts[push], forces[push]), (trial.timesteps[push], *settings)
                seen = readings[push], right.gains[push], right.weights[push]
                shown = basis[push], steps[push], room, values[push], slopes[push]
                slopes_of = by._replace(beside=by.beside._replace(torques=further.torques_of(push, n)))
                followed[push] = watch_readings(*pushed, balance, slopes_of, moving, seen, *shown)

        each = n * ((2 if led is None else 4) * n + coefficients) * max(columns, 1) * _stages(trial)
        share_out(run, npush, int(steps.sum()) * trial.substeps * each)
        if not followed.all():
            return None
        slopes[..., :nunknown] = self.by_unknowns(slopes[..., :nunknown])
        if idle:
            slopes = np.concatenate([slopes, np.zeros((*slopes.shape[:-1], idle))], axis=-1)
        return Coefficients(values, slopes)

    def lead(
        self, trial: ReadTrial, starts: Array, begins: Array, pushes: NDArray[np.intp], joints: Joints | None
    ) -> Filter:
        """A filter through some pushes of a trial (Eq. 35).

        Args:
            trial: with the torques that acted.
            starts: as `drive` has them.
            begins: their covariance (npush x 2 njoint x 2 njoint).
            pushes: which it runs through.
            joints: what they have beside the parameters; None for nothing.
        """
        npush, nreading, n = trial.readings.shape
        links, both = self.links, np.kron(np.eye(2), self.links)
        of_reading = (links * trial.noise**2) @ links.T
        covariances, seen = np.ascontiguousarray(both @ begins @ both.T), trial.readings @ links.T
        forces, (balance, _) = self._forces(trial), self.alone.moving(trial, joints)
        multiplications = int(trial.steps[pushes].sum()) * trial.substeps * 20 * n**3 * _stages(trial)

        def run(of_torque: Array, is_kept: bool) -> Filtered:
            found = run_of(npush, nreading, n, is_kept)

            def share(numbers: Iterator[int]) -> None:
                room = workspace(*self.space, 0, is_continuous=trial.is_continuous), spread_of(n)
                for push in (int(pushes[number]) for number in numbers):
                    pushed = starts[push], covariances[push], forces[push], seen[push]
                    moving = trial.timesteps[push], trial.substeps, trial.is_continuous
                    own = Filtered(*(each[push] for each in found))
                    noise, steps = (of_reading, of_torque), trial.steps[push]
                    found.sums[push] = lead(*pushed, balance, moving, noise, steps, *room, own)

            share_out(share, len(pushes), multiplications)
            return found

        to_joints = np.kron(np.eye(2), np.linalg.inv(links))
        return Filter(run, of_reading, covariances, trial.steps, pushes, lambda each: each @ to_joints.T)

    def _forces(self, trial: ReadTrial) -> Array:
        """What was commanded at each step (npush x nstep x njoint), in the kernel's coordinates."""
        return np.ascontiguousarray(trial.torques @ np.linalg.inv(self.links))


def _stages(trial: ReadTrial) -> int:
    """How often a step asks for accelerations: a Runge-Kutta step of a plant that moves continuously four times."""
    return 4 if trial.is_continuous else 1
