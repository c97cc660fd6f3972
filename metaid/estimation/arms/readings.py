"""What a fit compares on an arm with noisy sensors: the readings of each push, against twins that are driven by what
was commanded, whose starts may be unknown.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.compiled.arms import follow_torques
from metaid.estimation.arms.motions import STEP, THREADS, to_and_fro
from metaid.estimation.arms.trials import ArmReadTrial
from metaid.estimation.arms.unknowns import ArmUnknowns
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
from metaid.models import Array


@dataclass(frozen=True, eq=False)
class ArmReadings:
    """All `trials` of a noisy study. Windows grow from `shortest` of the horizon on.

    Compared are coefficients of the readings in `polynomials` (Eq. 28). Where starts are unknown, they are eliminated
    push by push (Eq. 29).
    """

    trials: Sequence[ArmReadTrial]
    unknowns: ArmUnknowns
    polynomials: int = POLYNOMIALS
    shortest: float = SHORTEST

    def __post_init__(self) -> None:
        if not any((trial.steps >= ends[0]).any() for trial, (ends, _) in self._each):
            raise ValueError("no push of any trial was seen to the end of its shortest window: nothing to compare")

    @property
    def spreads(self) -> Array:
        """Of the unknowns (nbase), beforehand."""
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
        pushes = sum(int(np.count_nonzero(trial.steps >= ends[0])) for trial, (ends, _) in self._each)
        return explained_by_noise(pushes * self.polynomials * self.trials[0].starts.shape[2])

    @property
    def extras(self) -> int:
        """How many coordinates and speeds of starts are unknown."""
        return sum(_extras(trial) for trial in self.trials)

    @property
    def _each(self) -> Iterator[tuple[ArmReadTrial, tuple[NDArray[np.int64], Array]]]:
        """Each trial with its windows."""
        return zip(self.trials, self._windows, strict=True)

    @cached_property
    def _windows(self) -> list[tuple[NDArray[np.int64], Array]]:
        """Of each trial the ends of its windows, and the polynomials on each (nwindow x nstep + 1 x ncoefficient)."""
        return [polynomial_windows(trial.torques.shape[1], self.polynomials, self.shortest) for trial in self.trials]

    def residuals(self, point: Array, windows: int) -> Residuals | None:
        """Those of the longest of the first `windows` windows, starts eliminated push by push."""
        count = len(self.unknowns.names)
        parts, cost, seen = [], 0.0, 0
        for number, (trial, (ends, _)) in enumerate(self._each):
            whitened = self._whitened(number, point)
            compared = self._compare(number, point[:count], whitened, windows)
            if compared is None:
                return None
            values, slopes = compared
            cost += 0.5 * float((values**2).sum() + (whitened**2).sum())
            seen += int(np.count_nonzero(trial.steps >= ends[0])) * values.shape[1]
            parts.append(eliminate(values, slopes, whitened, count))
        values, slopes, following = (np.concatenate([part[number] for part in parts]) for number in range(3))
        return Residuals(values, slopes, cost, seen, following)

    def by_joint(self, point: Array) -> tuple[Array, ...]:
        """Root mean square of the residuals of each trial (npush x njoint) on the longest window seen, in units of the
        noise; NaN where a push was not seen.
        """
        count, tables = len(self.unknowns.names), []
        for number, (trial, (ends, _)) in enumerate(self._each):
            shape = trial.starts.shape[::2]
            table = np.full(shape, np.nan)
            compared = self._compare(number, point[:count], self._whitened(number, point), self.stages)
            if compared is not None:
                seen = trial.steps >= ends[0]
                table[seen] = np.sqrt((compared[0].reshape(shape[0], -1, shape[1])[seen] ** 2).mean(axis=1))
            tables.append(table)
        return tuple(tables)

    def _whitened(self, number: int, point: Array) -> Array:
        """What is unknown of the starts of a trial (npush x nextra), in units of their spread."""
        first = len(self.unknowns.names) + sum(_extras(trial) for trial in self.trials[:number])
        trial = self.trials[number]
        return point[first : first + _extras(trial)].reshape(len(trial.starts), -1)

    def _compare(self, number: int, point: Array, whitened: Array, windows: int) -> tuple[Array, Array] | None:
        """Residuals of a trial (npush x nvalue) in units of the noise, and their derivatives (npush x nvalue x
        nunknown + nextra), those by the `whitened` starts last; zeros where a push was not seen.
        """
        trial, (ends, basis) = self.trials[number], self._windows[number]
        chosen = np.minimum((ends[None] <= trial.steps[:, None]).sum(axis=1), windows) - 1
        steps = np.where(chosen >= 0, ends[chosen], 0)
        # A start of one push has no influence on another, so those of all pushes are changed at once.
        count, further = len(point), whitened.shape[1]
        here, (there, back) = point[None], to_and_fro(point)
        still = np.repeat(here, further, axis=0)
        candidates = self.unknowns.parameters(np.concatenate([here, there, still, back, still]))
        steady = np.repeat(_starts(trial, whitened)[None], 1 + count, axis=0)
        moved = [[_starts(trial, whitened + sign * step) for step in STEP * np.eye(further)] for sign in (1.0, -1.0)]
        ahead, behind = (np.array(each).reshape(further, *steady.shape[1:]) for each in moved)
        starts = np.concatenate([steady, ahead, steady[1:], behind])
        seen = basis, np.maximum(chosen, 0), steps
        twin = follow_torques(self.unknowns.frames, candidates, starts, trial.torques, seen, trial.timestep, THREADS)
        if not twin.arrived[:, steps > 0].all():
            return None
        plants = np.einsum("ptk,ptj->pkj", basis[chosen], trial.readings * before(steps, trial.readings.shape[1]))
        is_seen = (steps > 0)[:, None, None]
        values = np.where(is_seen, (twin.values[0] - plants) / trial.noise, 0.0)
        half = 1 + count + further
        slopes = np.where(is_seen, (twin.values[1:half] - twin.values[half:]) / (2.0 * STEP * trial.noise), 0.0)
        npush = len(steps)
        return values.reshape(npush, -1), np.moveaxis(slopes.reshape(count + further, npush, -1), 0, -1)


def _extras(trial: ArmReadTrial) -> int:
    """How many coordinates and speeds of starts are unknown."""
    return 0 if trial.start_spread is None else len(trial.starts) * int(np.count_nonzero(trial.start_spread))


def _starts(trial: ArmReadTrial, whitened: Array) -> Array:
    """Joint coordinates and speeds at the starts (npush x 2 x njoint), `whitened` (npush x nextra) being what is
    unknown of them in units of their spread.
    """
    if trial.start_spread is None:
        return trial.starts
    starts = trial.starts.copy()
    unknown = trial.start_spread != 0.0
    starts[:, unknown] += whitened * trial.start_spread[unknown]
    return starts
