"""What a fit compares on a noisy plant: the readings of each push, against a twin that is driven by what was commanded
and whose start speeds are unknown within what pushes differ by.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.descent import Residuals
from metaid.estimation.noisy.polynomials import (
    POLYNOMIALS,
    SHORTEST,
    STRIDE,
    before,
    eliminate,
    explained_by_noise,
    polynomial_windows,
)
from metaid.estimation.trials import Replay
from metaid.estimation.twin import drive
from metaid.estimation.unknowns import Unknowns, known_alone
from metaid.models import Array

DRAWN = 100  # readings of a push that a replay keeps
DIFFERENCE, TINY = 1e-3, 1e-12  # of a further torque, as a share of the largest commanded; and no torque, in N m


@dataclass(frozen=True)
class ReadTrial:
    """What the sensors of a noisy plant read in one trial, and what it was sent.

    Attributes:
        timestep: in which the plant moves, in s.
        readings: joint angles (npush x nstep + 1 x njoint), in rad, the one right after the push first.
        torques: as they were commanded (npush x nstep x njoint), in N m.
        steps: how many steps (npush) of each push were seen before a fall.
        start_speeds: joint speeds (npush x njoint), in rad/s, that such pushes gave in a calibration.
        start_spread: what pushes differ by, a root of the covariance of the start speeds (npush x njoint x njoint), in
            rad/s: any L with covariance L Lᵀ. None where they are all alike.
        noise: standard deviation of a reading of each joint (njoint), in rad, from the plant at rest.
        substeps: how many timesteps there are between two readings, and between two torques.
    """

    timestep: float
    readings: Array
    torques: Array
    steps: NDArray[np.int64]
    start_speeds: Array
    start_spread: Array | None
    noise: Array
    substeps: int = 1

    @cached_property
    def forces(self) -> Array:
        """The torques as generalised forces in absolute angles (npush x nstep x njoint), in N m."""
        return np.ascontiguousarray(-np.diff(self.torques, axis=-1, append=0.0))

    @property
    def extras(self) -> int:
        """How many start speeds are unknown."""
        return 0 if self.start_spread is None else self.start_speeds.size


@dataclass(frozen=True)
class Readings:
    """All `trials` of a noisy study. `gravity` in m/s²; windows grow from `shortest` of the horizon on."""

    trials: Sequence[ReadTrial]
    unknowns: Unknowns
    gravity: float
    polynomials: int = POLYNOMIALS
    shortest: float = SHORTEST

    def __post_init__(self) -> None:
        if not any((trial.steps >= ends[0]).any() for trial, (ends, _) in self._each):
            raise ValueError("no push of any trial was seen to the end of its shortest window: nothing to compare")

    @property
    def spreads(self) -> Array:
        """Of the log factors (nunknown), beforehand."""
        return np.full(len(self.unknowns.names), self.unknowns.spread)

    @property
    def stages(self) -> int:
        """How many windows there are."""
        return max(len(ends) for ends, _ in self._windows)

    @property
    def stride(self) -> int:
        """Windows grow to twice their length at once, where that leads nowhere by less."""
        return STRIDE

    @property
    def explained_below(self) -> float:
        """A misfit below this is explained by noise."""
        seen = sum(int(np.count_nonzero(trial.steps >= ends[0])) for trial, (ends, _) in self._each) * self.polynomials
        return explained_by_noise(seen * self.trials[0].start_speeds.shape[1])

    @property
    def extras(self) -> int:
        """How many start speeds are unknown."""
        return sum(trial.extras for trial in self.trials)

    @property
    def _each(self) -> Iterator[tuple[ReadTrial, tuple[NDArray[np.int64], Array]]]:
        """Each trial with its windows."""
        return zip(self.trials, self._windows, strict=True)

    @cached_property
    def _windows(self) -> list[tuple[NDArray[np.int64], Array]]:
        """Of each trial the ends of its windows, and the polynomials on each (nwindow x nstep + 1 x ncoefficient)."""
        return [polynomial_windows(trial.torques.shape[1], self.polynomials, self.shortest) for trial in self.trials]

    def residuals(self, point: Array, windows: int, torques: Sequence[Array] | None = None) -> Residuals | None:
        """Those of the longest of the first `windows` windows, start speeds eliminated push by push. Given further
        joint `torques` of each trial (ntorque x npush x nstep x njoint), in N m, their sizes are unknowns, too, behind
        the others.
        """
        count = len(self.unknowns.names)
        parts, cost, seen, first = [], 0.0, 0, count
        for number, trial in enumerate(self.trials):
            whitened = point[first : first + trial.extras].reshape(-1, trial.start_speeds.shape[1])
            first += trial.extras
            compared = self._compare(number, point[:count], whitened, windows)
            if compared is None:
                return None
            values, slopes = compared
            if torques is not None:
                further = self._compare_driven(number, point[:count], whitened, values, torques[number])
                if further is None:
                    return None
                slopes = np.concatenate([slopes[..., :count], further, slopes[..., count:]], axis=-1)
            cost += 0.5 * float((values**2).sum() + (whitened**2).sum())
            seen += int(np.count_nonzero(trial.steps >= self._windows[number][0][0])) * values.shape[1]
            parts.append(eliminate(values, slopes, whitened, count + (0 if torques is None else len(torques[number]))))
        values, slopes, following = (np.concatenate([part[number] for part in parts]) for number in range(3))
        return Residuals(values, slopes, cost, seen, following)

    def by_joint(self, point: Array) -> tuple[Array, ...]:
        """Root mean square of the residuals of each trial (npush x njoint) on the longest window seen, in units of the
        noise; NaN where a push was not seen.
        """
        count = len(self.unknowns.names)
        tables, first = [], count
        for number, trial in enumerate(self.trials):
            whitened = point[first : first + trial.extras].reshape(-1, trial.start_speeds.shape[1])
            first += trial.extras
            compared = self._compare(number, point[:count], whitened, self.stages)
            table = np.full(trial.start_speeds.shape, np.nan)
            if compared is not None:
                seen = trial.steps >= self._windows[number][0][0]
                values = compared[0].reshape(*trial.start_speeds.shape, -1)
                table[seen] = np.sqrt((values[seen] ** 2).mean(axis=-1))
            tables.append(table)
        return tuple(tables)

    def replay(self, number: int, point: Array) -> Replay:
        """The trial of that `number`, some of its readings left out, and the twin at a `point` in its place."""
        trial, count = self.trials[number], len(self.unknowns.names)
        first = count + sum(each.extras for each in self.trials[:number])
        starts = _starts(trial, point[first : first + trial.extras].reshape(-1, trial.start_speeds.shape[1]))
        (npush, nreading, _), last = trial.readings.shape, self._windows[number][0][-1]
        kept = np.unique(np.linspace(0, last, min(last, DRAWN) + 1).round().astype(int))
        basis = np.zeros((nreading, len(kept)))
        basis[kept, np.arange(len(kept))] = 1.0  # each coefficient is the angle at one reading
        twin, steps = known_alone(self.unknowns, point[:count]), np.minimum(trial.steps, last)
        alike = replace(trial, start_spread=None)
        motion = drive(alike, starts, steps, np.tile(basis, (npush, 1, 1)), twin, np.empty(0), self.gravity)
        shown = (kept <= steps[:, None]) & (steps[:, None] > 0)
        seen = np.where(shown[..., None], trial.readings[:, kept], np.nan)
        simulated = np.full_like(seen, np.nan)
        if motion is not None:
            simulated[shown] = motion.values.swapaxes(1, 2)[shown]
        return Replay(trial.timestep * trial.substeps * kept, seen, simulated, trial.noise)

    def _compare(
        self, number: int, log_factors: Array, whitened: Array, windows: int, added: Array | None = None
    ) -> tuple[Array, Array] | None:
        """Residuals of a trial (npush x nvalue) in units of the noise, and their derivatives (npush x nvalue x
        nunknown + njoint), those by the `whitened` start speeds last; zeros where a push was not seen.
        The torques `added` (npush x nstep x njoint), in N m, act beside what was commanded.
        """
        trial, (ends, basis) = self.trials[number], self._windows[number]
        if added is not None:
            trial = replace(trial, torques=trial.torques + added)
        chosen = np.minimum((ends[None] <= trial.steps[:, None]).sum(axis=1), windows) - 1
        steps = np.where(chosen >= 0, ends[chosen], 0)
        spread, starts = trial.start_spread, _starts(trial, whitened)
        twin = drive(trial, starts, steps, basis[chosen], self.unknowns, log_factors, self.gravity)
        if twin is None:
            return None
        plants = np.einsum("ptk,ptj->pjk", basis[chosen], trial.readings * before(steps, trial.readings.shape[1]))
        unit = 1.0 / trial.noise[None, :, None]
        npush = len(steps)
        slopes = (unit[..., None] * twin.slopes).reshape(npush, plants[0].size, -1)
        if spread is not None:
            count = len(log_factors)
            slopes[..., count:] = slopes[..., count:] @ spread
        return (unit * (twin.values - plants)).reshape(npush, -1), slopes

    def _compare_driven(
        self, number: int, log_factors: Array, whitened: Array, values: Array, torques: Array
    ) -> Array | None:
        """The derivatives (npush x nvalue x ntorque) of the `values` of a trial on its longest windows by the sizes of
        further `torques` (ntorque x npush x nstep x njoint), by differences. None where the twin cannot follow.
        """
        largest, alone = np.abs(self.trials[number].torques).max(), known_alone(self.unknowns, log_factors)
        slopes = np.zeros((*values.shape, len(torques)))
        for column, torque in enumerate(torques):
            size = DIFFERENCE * largest / max(float(np.abs(torque).max()), TINY)
            compared = replace(self, unknowns=alone)._compare(number, np.empty(0), whitened, self.stages, size * torque)
            if compared is None:
                return None
            slopes[..., column] = (compared[0] - values) / size
        return slopes


def _starts(trial: ReadTrial, whitened: Array) -> Array:
    """The start speeds q̇_0 + L u of each push (npush x njoint), in rad/s, u being `whitened` (npush x njoint)."""
    if trial.start_spread is None:
        return trial.start_speeds
    return np.asarray(trial.start_speeds + np.einsum("pij,pj->pi", trial.start_spread, whitened), dtype=np.float64)
