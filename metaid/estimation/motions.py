"""What a fit compares on a plant without noise: the windows of each push, against a twin under the same laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.descent import NOTHING, Residuals
from metaid.estimation.faults import NO_FAULTS, SearchedFaults
from metaid.estimation.trials import Replay, WatchedTrial
from metaid.estimation.twin import Shown, twin_of
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array

Quantity = Literal["speed", "frequency", "both"]
DRAWN = 400  # times at which a replay has the twin, which may oscillate
ENOUGH = 4  # residuals an unknown, of windows that are to grow
TINY = 1e-100  # in place of a denominator that is 0
EXPLAINED = 3.0  # a misfit below this is rounding


@dataclass(frozen=True, eq=False)
class WatchedTrials:
    """All `trials` of a study whose windows are compared with a twin, and what is unknown of it."""

    trials: Sequence[WatchedTrial]
    unknowns: Unknowns

    extras: ClassVar[int] = 0  # what the speeds were right after a push is read

    @property
    def spreads(self) -> Array:
        return np.full(len(self.unknowns.names), self.unknowns.spread)

    @property
    def stages(self) -> int:
        """How many windows the longest trial has."""
        return max(len(trial.ends) for trial in self.trials)

    def least_cost(self, point: Array, windows: int) -> float:
        """0: nothing less than the residuals tells it."""
        return 0.0


@dataclass(frozen=True, eq=False)
class Motions(WatchedTrials):
    """What of all trials is `compared` with the twin, scaled by what rounding leaves of the largest.

    `speed`: the signed change of joint speed from the push to the end of a window (Eq. 61). `frequency`, of a chain:
    Rice's, √(∫ q̈² dt / ∫ q̇² dt) of that joint up to there, which has no sign (Eq. 25).
    """

    compared: Quantity = "speed"

    faults: ClassVar[SearchedFaults] = NO_FAULTS  # they are searched in readings
    stride: ClassVar[int] = 1  # windows grow one by one
    least_gain: ClassVar[float] = NOTHING  # what rounding leaves
    explained_below: ClassVar[float] = EXPLAINED

    def __post_init__(self) -> None:
        if not any(trial.windows.seen.any() for trial in self.trials):
            raise ValueError("no push of any trial was seen to the end of its shortest window: nothing to compare")

    @property
    def rough_stages(self) -> int:
        """All but those of the longest windows."""
        return super().stages - 1

    @property
    def stages(self) -> int:
        """A last one is of all pushes, where a share of them leads there."""
        return super().stages + (self._stride > 1)

    def residuals(self, point: Array, windows: int) -> Residuals | None:
        """Those of the first `windows` windows, or None where the twin did not get through them. While these are to
        grow, a share of the pushes is enough.
        """
        parts, every = [], 1 if windows >= self.stages else self._stride
        twin = twin_of(self.unknowns, point)
        for trial in (each.thinned(every) for each in self.trials):
            seen = trial.seen(windows)
            if not seen.any():
                continue
            motion = twin.watch(trial, seen.shape[1], energies=self.compared != "speed")
            if (motion.reached < seen.sum(axis=1)).any():
                return None
            if self.compared != "frequency":
                parts.append(self._of_speeds(trial, motion, seen))
            if self.compared != "speed":
                parts.append(self._of_frequencies(trial, motion, seen))
        values, slopes = (np.concatenate(each) for each in zip(*parts, strict=True))
        cost = 0.5 * float(values @ values)
        return Residuals(values, slopes, cost, len(values), np.empty((0, 1 + len(point))))

    def by_joint(self, point: Array) -> tuple[Array, ...]:
        """Root mean square of all residuals of each trial (npush x njoint), in their units; NaN where a push was not
        seen.
        """
        alone = replace(self, unknowns=self.unknowns.alone(point))
        residuals = alone.residuals(np.empty(0), alone.stages)
        if residuals is None:
            return tuple(np.full(trial.start_speeds.shape, np.nan) for trial in self.trials)
        first, tables, kinds = 0, [], 2 if self.compared == "both" else 1
        for trial in self.trials:
            seen, n = trial.seen(len(trial.ends)), trial.start_speeds.shape[1]
            squares = np.zeros((kinds, *seen.shape, n))
            last = first + squares[:, seen].size
            squares[:, seen] = residuals.values[first:last].reshape(kinds, -1, n) ** 2
            with np.errstate(invalid="ignore"):  # of a push that was not seen
                tables.append(np.sqrt(squares.sum(axis=(0, 2)) / (kinds * seen.sum(axis=1, keepdims=True))))
            first = last
        return tuple(tables)

    def replay(self, number: int, point: Array) -> Replay:
        """The trial of that `number`, and the twin at a `point` (nunknown) in its place."""
        trial = self.trials[number]
        dense = np.linspace(1, trial.ends[-1], DRAWN).astype(np.int64)
        steps = np.unique(np.concatenate([trial.ends, dense]))
        angles, is_shown = twin_of(self.unknowns, point).trace(trial, steps)
        seen, simulated = np.full(angles.shape, np.nan), np.where(is_shown[..., None], angles, np.nan)
        windows = trial.seen(len(trial.ends))
        seen[:, np.searchsorted(steps, trial.ends)] = np.where(windows[..., None], trial.windows.angles, np.nan)
        noise = np.zeros(angles.shape[2])
        return Replay(trial.timestep * steps, seen, simulated, noise, self.unknowns.joints)

    @cached_property
    def _stride(self) -> int:
        """Of pushes, so that one window of each has ENOUGH times as many residuals as there are unknowns."""
        residuals = sum(trial.start_speeds.size for trial in self.trials)
        return max(1, residuals // (ENOUGH * max(1, len(self.unknowns.names))))

    @cached_property
    def _largest_frequency(self) -> float:
        """Of any joint in any window of all trials, in rad/s. One that coasts has none of its own to compare with."""
        largest = TINY
        for trial in self.trials:
            seen, shown = trial.seen(len(trial.ends)), trial.windows
            if seen.any():
                largest = max(largest, float(frequency(shown.speed_energy, shown.acceleration_energy)[seen].max()))
        return largest

    def _of_speeds(self, trial: WatchedTrial, motion: Shown, seen: NDArray[np.bool_]) -> tuple[Array, Array]:
        unit = 1.0 / (self.unknowns.rounding * float(np.abs(trial.start_speeds).max()))
        values = motion.speeds[seen] - trial.windows.speeds[:, : seen.shape[1]][seen]
        return unit * values.ravel(), unit * motion.speed_slopes[seen].reshape(values.size, -1)

    def _of_frequencies(self, trial: WatchedTrial, motion: Shown, seen: NDArray[np.bool_]) -> tuple[Array, Array]:
        windows, shown = seen.shape[1], trial.windows
        plants = frequency(shown.speed_energy[:, :windows][seen], shown.acceleration_energy[:, :windows][seen])
        speed_energy, acceleration_energy = motion.speed_energy[seen], motion.acceleration_energy[seen]
        twins = frequency(speed_energy, acceleration_energy)
        unit = 1.0 / (self.unknowns.rounding * self._largest_frequency)
        # d√(A/S) = (dA − f² dS) / (2 f S); 0 for a joint that nothing accelerates: it has none
        scale = 0.5 * unit / (np.maximum(twins, 1.0 / unit) * np.maximum(speed_energy, TINY))
        slopes = motion.acceleration_energy_slopes[seen] - twins[..., None] ** 2 * motion.speed_energy_slopes[seen]
        slopes = scale[..., None] * slopes
        return unit * (twins - plants).ravel(), slopes.reshape(twins.size, -1)


def frequency(speed_energy: Array, acceleration_energy: Array) -> Array:
    """Rice's frequency √(∫ q̈² dt / ∫ q̇² dt) of each joint (...), in rad/s; 0 of one that never moved."""
    return np.asarray(np.sqrt(acceleration_energy / np.maximum(speed_energy, TINY)))
