"""The twin of a planar chain: its compiled loops, push by push, on several threads. Its derivatives are exact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import Run, compiled, run_of, share_out, spread_of
from metaid.estimation.driven import watch_readings
from metaid.estimation.filtered import lead
from metaid.estimation.log_unknowns import LogUnknowns
from metaid.estimation.motion import watch_push
from metaid.estimation.trials import (
    NOTHING_FURTHER,
    Coefficients,
    Driven,
    Filtered,
    Further,
    Gains,
    Joints,
    ReadTrial,
    WatchedTrial,
)
from metaid.estimation.twin import Filter, Motion
from metaid.estimation.workspace import Balance, Derivatives, balance, derivatives, workspace
from metaid.models import Array, Lumps

NOTHING_ELSE = np.empty((0, 0))  # forces beside the law


@dataclass(frozen=True, eq=False)
class PlanarTwin:
    """A chain with these `log_factors` (nunknown); see `twin.Twin`."""

    unknowns: LogUnknowns
    log_factors: Array

    @cached_property
    def lumps(self) -> Lumps:
        """Of the chain."""
        return self.unknowns.lumps(self.log_factors)

    @cached_property
    def _alone(self) -> PlanarTwin:
        """The same chain, of which nothing is unknown."""
        return PlanarTwin(self.unknowns.alone(self.log_factors), np.empty(0))

    def watch(self, trial: WatchedTrial, windows: int, energies: bool = False) -> Motion:
        return self._watch(trial, np.ascontiguousarray(trial.ends[:windows]), energies)[0]

    def _watch(self, trial: WatchedTrial, ends: NDArray[np.int64], energies: bool) -> tuple[Motion, Array]:
        """The motion up to the `ends` of windows, in steps, and the joint angles there (npush x nwindow x njoint)."""
        npush, _, n = trial.starts.shape
        nunknown, shape = len(self.log_factors), (npush, len(ends), n)
        shown = np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape)
        of_energies = *shape, nunknown * energies
        slopes = np.empty((*shape, nunknown)), np.empty(of_energies), np.empty(of_energies)
        reached = np.zeros(npush, dtype=np.int64)
        gravity, stiffness = self.unknowns.gravity, float(np.max(trial.stiffness))
        forces = balance(trial.law, self.lumps, gravity, stiffness), derivatives(self.unknowns, self.lumps)
        common = NOTHING_ELSE, *forces, (trial.timestep, energies), ends

        def run(first: int, stride: int) -> None:
            room = workspace(n, nunknown, energies)
            _watch_pushes(first, stride, trial.starts, *common, room, shown, slopes, reached)

        share_out(run, npush, npush * int(ends[-1]) * 2 * n * n * nunknown)
        return Motion(shown[1], slopes[0], shown[2], shown[3], slopes[1], slopes[2], reached), shown[0]

    def trace(self, trial: WatchedTrial, steps: NDArray[np.int64]) -> tuple[Array, NDArray[np.bool_]]:
        motion, angles = self._alone._watch(trial, steps, False)
        return angles, (steps <= trial.last[:, None]) & (np.arange(len(steps)) < motion.reached[:, None])

    def drive(self, driven: Driven, joints: Joints | None, led: Gains | None = None) -> Coefficients | None:
        trial, starts, steps, basis, further = driven
        (npush, _, n), coefficients = starts.shape, basis.shape[2]
        extra = 0 if trial.start_spread is None else trial.start_spread.shape[-1]
        own = len(self.log_factors) + further.size
        columns = own + extra
        values, slopes = np.empty((npush, n, coefficients)), np.empty((npush, n, coefficients, columns))
        followed = np.zeros(npush, dtype=np.bool_)
        forces, by = self._forces(trial, joints, further)
        settings = own, extra, trial.substeps, trial.is_continuous
        readings = np.cumsum(trial.readings, axis=-1) if led is not None else np.empty((npush, 0, n))
        gains = (
            (np.empty((npush, 0, 2 * n, n)), np.empty((npush, 0, n, n))) if led is None else (led.gains, led.weights)
        )

        def run(first: int, stride: int) -> None:
            room = workspace(n, columns, False, trial.is_continuous)
            for push in range(first, npush, stride):
                pushed, moving = (starts[push], trial.forces[push]), (trial.timesteps[push], *settings)
                right = readings[push], gains[0][push], gains[1][push]
                shown = basis[push], steps[push], room, values[push], slopes[push]
                slopes_of = by._replace(beside=by.beside._replace(torques=further.torques_of(push, n)))
                followed[push] = watch_readings(*pushed, forces, slopes_of, moving, right, *shown)

        each = n * ((2 if led is None else 4) * n + coefficients) * columns * _stages(trial)
        share_out(run, npush, int(steps.sum()) * trial.substeps * each)
        return Coefficients(values, slopes) if followed.all() else None

    def lead(self, filtered: Filtered, joints: Joints | None) -> Filter:
        trial, starts, begins, pushes = filtered
        npush, readings, n = trial.readings.shape
        links = np.tril(np.ones((n, n)))  # absolute angles are sums of the joints'
        torques = np.eye(n) - np.eye(n, k=1)  # the torque of a joint turns its link, and the one below the other way
        of_reading, both = (links * trial.noise**2) @ links.T, np.kron(np.eye(2), links)
        covariances, seen = np.ascontiguousarray(both @ begins @ both.T), np.cumsum(trial.readings, axis=-1)
        forces, nothing = self._alone._forces(trial, joints)
        settings = trial.substeps, trial.is_continuous, nothing
        multiplications = int(trial.steps[pushes].sum()) * trial.substeps * 20 * n**3 * _stages(trial)

        def run(noise: tuple[Array, Array], is_kept: bool) -> Run:
            found = run_of(npush, readings, n, is_kept)

            def share(first: int, stride: int) -> None:
                room = workspace(n, 0, False, trial.is_continuous), spread_of(n)
                for push in pushes[first::stride].tolist():
                    pushed = starts[push], covariances[push], trial.forces[push], seen[push]
                    moving, own = (trial.timesteps[push], *settings), Run(*(each[push] for each in found))
                    found.sums[push] = lead(*pushed, forces, moving, noise, trial.steps[push], *room, own)

            share_out(share, len(pushes), multiplications)
            return found

        def joint_states(states: Array) -> Array:
            absolute = states.reshape(npush, readings, 2, n)
            return np.diff(absolute, axis=-1, prepend=0.0).reshape(states.shape)

        return Filter(run, of_reading, torques, covariances, trial.steps, pushes, joint_states)

    def _forces(
        self, trial: ReadTrial, joints: Joints | None, further: Further = NOTHING_FURTHER
    ) -> tuple[Balance, Derivatives]:
        """What the chain moves by where there is no law, with its derivatives, also by what is `further` unknown."""
        rubs, gravity = further.joints is not None and bool(further.joints.dry.any()), self.unknowns.gravity
        own = balance(None, self.lumps, gravity, joints=joints, is_continuous=trial.is_continuous, rubs=rubs)
        return own, derivatives(self.unknowns, self.lumps, further)


def _stages(trial: ReadTrial) -> int:
    """How often a step asks for accelerations: a Runge-Kutta step of a plant that moves continuously four times."""
    return 4 if trial.is_continuous else 1


@compiled
def _watch_pushes(first, stride, starts, forces, balance, derivatives, settings, ends, work, shown, slopes, reached):  # type: ignore[no-untyped-def]
    """Every `stride`-th push from the `first` on."""
    angles, speeds, speed_energy, acceleration_energy = shown
    by_speed, by_speed_energy, by_acceleration_energy = slopes
    for push in range(first, starts.shape[0], stride):
        seen = angles[push], speeds[push], speed_energy[push], acceleration_energy[push]
        seen_slopes = by_speed[push], by_speed_energy[push], by_acceleration_energy[push]
        reached[push] = watch_push(starts[push], forces, balance, derivatives, settings, ends, work, seen, seen_slopes)
