"""What a fit compares on a noisy plant: the readings of each push, against a twin that is driven by what was commanded
and whose start speeds are unknown within what pushes differ by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.descent import Residuals
from metaid.estimation.noisy.polynomials import before
from metaid.estimation.noisy.windows import Compared, ReadingsInWindows
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


@dataclass(frozen=True, eq=False)
class Readings(ReadingsInWindows[ReadTrial, Unknowns]):
    """All `trials` of a noisy study of a chain. `gravity` in m/s²."""

    gravity: float

    def residuals_with(self, point: Array, torques: Sequence[Array]) -> Residuals | None:
        """Those on all windows with further joint `torques` of each trial (ntorque x npush x nstep x njoint), in N m,
        whose sizes are unknowns, too, behind the others.
        """

        def _compared(number: int, log_factors: Array, whitened: Array, windows: int) -> Compared | None:
            compared = self._compare(number, log_factors, whitened, windows)
            if compared is None:
                return None
            values, slopes = compared
            further = self._compare_driven(number, log_factors, whitened, values, torques[number])
            if further is None:
                return None
            count = len(log_factors)
            return values, np.concatenate([slopes[..., :count], further, slopes[..., count:]], axis=-1)

        return self._eliminated(point, self.stages, _compared, len(self.unknowns.names) + len(torques[0]))

    def replay(self, number: int, point: Array) -> Replay:
        """The trial of that `number`, some of its readings left out, and the twin at a `point` in its place."""
        trial, (log_factors, whitened) = self.trials[number], self._of_trial(number, point)
        starts = _starts(trial, whitened)
        (npush, nreading, _), last = trial.readings.shape, self._windows[number][0][-1]
        kept = np.unique(np.linspace(0, last, min(last, DRAWN) + 1).round().astype(int))
        basis = np.zeros((nreading, len(kept)))
        basis[kept, np.arange(len(kept))] = 1.0  # each coefficient is the angle at one reading
        twin, steps = known_alone(self.unknowns, log_factors), np.minimum(trial.steps, last)
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
    ) -> Compared | None:
        """What a trial shows; derivatives by the `whitened` start speeds are the last. The torques `added` (npush x
        nstep x njoint), in N m, act beside what was commanded.
        """
        trial, (_, basis) = self.trials[number], self._windows[number]
        if added is not None:
            trial = replace(trial, torques=trial.torques + added)
        chosen, steps = self._longest(number, windows)
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
