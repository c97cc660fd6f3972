"""What a fit compares on an arm with noisy sensors: the readings of each push, against twins that are driven by what
was commanded, whose starts may be unknown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.compiled.arms import follow_torques
from metaid.estimation.arms.motions import STEP, THREADS, beside
from metaid.estimation.arms.trials import ArmReadTrial
from metaid.estimation.arms.unknowns import ArmUnknowns, ComparedOfArm
from metaid.estimation.noisy.polynomials import before
from metaid.estimation.noisy.windows import Compared, ReadingsInWindows
from metaid.models import Array

LEAST_GAIN = 1e-3  # of cost: dry friction makes it uneven, and a descent would feel its way to no avail


@dataclass(frozen=True, eq=False)
class ArmReadings(ComparedOfArm, ReadingsInWindows[ArmReadTrial, ArmUnknowns]):
    """All `trials` of a noisy study of an arm. Where starts are unknown, they are eliminated push by push (Eq. 29)."""

    @property
    def least_gain(self) -> float:
        """A step that promises less moves no unknown by a twentieth of its standard deviation."""
        return LEAST_GAIN

    def _compare(self, number: int, point: Array, whitened: Array, windows: int) -> Compared | None:
        """What a trial shows; derivatives by the `whitened` starts are the last."""
        trial = self.trials[number]
        # A start of one push has no influence on another, so those of all pushes are changed at once.
        count, further = len(point), whitened.shape[1]
        here = np.repeat(point[None], 1 + further, axis=0)
        candidates = self.unknowns.parameters(np.concatenate([here[:1], beside(point), here[1:]]))
        steady = np.repeat(_starts(trial, whitened)[None], 1 + count, axis=0)
        moved = [_starts(trial, whitened + step) for step in STEP * np.eye(further)]
        starts = np.concatenate([steady, np.array(moved).reshape(further, *steady.shape[1:])])
        found = self._residuals(number, candidates, starts, windows)
        if found is None:
            return None
        return found[0], np.moveaxis((found[1:] - found[0]) / STEP, 0, -1)

    def _values(self, number: int, point: Array, whitened: Array) -> Array | None:
        """Of one twin, where `_compare` has one beside it along each unknown."""
        candidate, starts = self.unknowns.parameters(point[None]), _starts(self.trials[number], whitened)[None]
        found = self._residuals(number, candidate, starts, self.stages)
        return None if found is None else found[0]

    def _residuals(self, number: int, candidates: Array, starts: Array, windows: int) -> Array | None:
        """Those of a trial (ncandidate x npush x nvalue) with twins of these parameters (ncandidate x njoint x 13) from
        these starts (ncandidate x npush x 2 x njoint); None where one of them cannot follow.
        """
        trial, (_, basis) = self.trials[number], self._windows[number]
        chosen, steps = self._longest(number, windows)
        seen = basis, np.maximum(chosen, 0), steps
        twin = follow_torques(self.unknowns.frames, candidates, starts, trial.torques, seen, trial.timestep, THREADS)
        if not twin.arrived[:, steps > 0].all():
            return None
        plants = np.einsum("ptk,ptj->pkj", basis[chosen], trial.readings * before(steps, trial.readings.shape[1]))
        residuals = np.where((steps > 0)[:, None, None], (twin.values - plants) / trial.noise, 0.0)
        return residuals.swapaxes(2, 3).reshape(*starts.shape[:2], -1)


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
