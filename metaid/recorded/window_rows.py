"""Windows of one length as linear equations: their fit, with the delay of the torques or beside other unknowns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.fit import Fit, belief_of, covariance_of, fit, grams_of
from metaid.recorded.linear_model import LinearModel
from metaid.recorded.log import Record
from metaid.recorded.suspects import NOTICED, SIGNIFICANT, WORTH, Suspect
from metaid.recorded.windows import TESTS, Windows

LASTS = 0.3  # s: how long an error of the model lasts at least
DELAYS = np.arange(-0.004, 0.0301, 0.002)  # s
ENOUGH = 3  # rows an unknown, at least
STEPS = 3  # from the best of them on


@dataclass(frozen=True)
class WindowRows:
    """Windows of one length, as rows of linear equations."""

    windows: Windows
    record: Record
    model: LinearModel

    @cached_property
    def rows(self) -> Array:
        """The averaged torque for a unit of each unknown (nwindow x ntest x njoint x nparam)."""
        return self.windows.rows(self.model)

    @property
    def all(self) -> NDArray[np.bool_]:
        """Every window (nwindow)."""
        return np.ones(len(self.windows), dtype=np.bool_)

    @property
    def lags(self) -> int:
        """How many windows an error lasts."""
        return int(np.ceil(max(LASTS, self.windows.span) / (0.5 * self.windows.span)))

    @property
    def is_enough(self) -> bool:
        """Whether there are a few times as many rows as unknowns, so that two thirds of them are enough, too."""
        return len(TESTS) * len(self.windows) * self.model.njoint >= ENOUGH * len(self.model.names)

    def fitted(self, which: NDArray[np.bool_], delay: float | None) -> tuple[Fit, float, Array]:
        """The fit of the windows `which` (nwindow), the delay in s, and the covariance of the unknowns, the delay last
        where it is unknown.
        """
        rows = self.rows[which]
        if delay is not None:
            torques = self.windows.torques(self.record, delay)[which]
            found = fit(rows, torques, belief_of(self.model, rows, torques))
            return found, delay, covariance_of(found, rows, self.lags)
        found, late, widened = self._with_delay(which, rows)
        return found, late, covariance_of(found, widened, self.lags)

    def changed(self, suspect: Suspect, torques: Array, values: Array) -> tuple[Array, Array, list[int]]:
        """How much the unknowns hang on what is suspected (nparam), their standard deviations beside it (nparam), and
        in which joints that is not nothing.

        They differ from `values` (nparam) beside it. Where it is in a joint for certain, and a size of it is expected,
        there may be as much of it in every column as in the root mean square of all: other unknowns may hide it.
        """
        columns, nparam = suspect.columns, len(values)
        nother = columns.shape[-1]
        rows = np.concatenate([self.rows, columns], axis=-1)
        nominal, precision = belief_of(self.model, self.rows, torques)
        sizes = (columns**2).sum(axis=(0, 1, 2))
        if suspect.deviations is None:
            other = 1e-6 * (sizes + sizes.max()) / float((torques**2).mean())
        else:
            other = suspect.deviations**-2.0
        precision = np.pad(precision, (0, nother))
        precision[range(nparam, nparam + nother), range(nparam, nparam + nother)] = other
        found = fit(rows, torques, (np.append(nominal, np.zeros(nother)), precision))
        shares = np.eye(nother) if suspect.of_joints is None else suspect.of_joints
        seen = shares @ found.values[nparam:]
        covariance = covariance_of(found, rows, self.lags)
        deviations = np.sqrt(np.einsum("ij,jk,ik->i", shares, covariance[nparam:, nparam:], shares))
        if not (np.abs(seen) > NOTICED * deviations).any():
            return np.zeros(nparam), np.zeros(nparam), []
        explained = np.sqrt(((columns @ found.values[nparam:]) ** 2).mean())
        worth = explained > WORTH * np.sqrt((torques**2).mean())
        strong = (np.abs(seen) > SIGNIFICANT * deviations) & worth
        joints = sorted({suspect.joints[at] for at in np.flatnonzero(strong)})
        hangs = (found.values[:nparam] - values) ** 2
        if suspect.deviations is not None and joints:
            size = np.sqrt(((found.values[nparam:] / suspect.deviations) ** 2).mean())
            unseen = np.linalg.solve(found.precision[:nparam, :nparam], found.precision[:nparam, nparam:])
            hangs += ((unseen * suspect.deviations * size) ** 2).sum(axis=1)
        return np.sqrt(hangs), np.sqrt(np.diag(covariance)[:nparam]), joints

    def _with_delay(self, which: NDArray[np.bool_], rows: Array) -> tuple[Fit, float, Array]:
        """The fit with the delay that leaves least, by a scan and then Newton's steps; its rows, the delay's last."""
        grams = grams_of(rows)
        late = float(min(DELAYS, key=lambda delay: self._left(which, rows, grams, float(delay))))
        step = self.record.period
        for _ in range(STEPS):
            before, torques, after = (
                self.windows.torques(self.record, late + shift)[which] for shift in (-step, 0.0, step)
            )
            slope = (before - after) / (2.0 * step)
            widened = np.concatenate([rows, slope[..., None]], axis=-1)
            nominal, precision = belief_of(self.model, rows, torques)
            precision = np.pad(precision, (0, 1))
            precision[-1, -1] = 1e-6 * float((slope**2).sum()) / float((torques**2).mean() + 1e-300)
            found = fit(widened, torques, (np.append(nominal, 0.0), precision))
            late = float(np.clip(late + found.values[-1], DELAYS[0], DELAYS[-1]))
        return found, late, widened

    def _left(self, which: NDArray[np.bool_], rows: Array, grams: Array, delay: float) -> float:
        torques = self.windows.torques(self.record, delay)[which]
        found = fit(rows, torques, belief_of(self.model, rows, torques), grams)
        return float(np.linalg.slogdet(_covariance(found.left))[1])


def _covariance(left: Array) -> Array:
    flat = left.reshape(-1, left.shape[-1])
    return flat.T @ flat / len(flat) + 1e-18 * np.eye(flat.shape[1])
