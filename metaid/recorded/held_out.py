"""How well what some parts of the logs say predicts the parts that were left out: of torques, and of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.motion import AHEAD, Begun, Motion, simulated, starts_of
from metaid.recorded.weak_form.equations import Equations, Solution
from metaid.recorded.weak_form.folds import Fold
from metaid.recorded.weak_form.normal import ZERO
from metaid.recorded.weak_form.smoothed import Smoothed
from metaid.recorded.weak_form.windows import SHIFT

FADES = 4.0  # periods of the filter's cut-off, in which what is beyond a row leaves it but for 1e-4
ZERO_STEPS = 3  # of Newton's, for the zeros of a log that was held out


@dataclass(frozen=True)
class LeftOutLog:
    """What was predicted of one log of a `fold`, in its `rows`, so many of each joint (njoint): sums of `squares` of
    what was missed and of the `whole` (njoint each), by these unknowns (nparam) and zeros (njoint).
    """

    fold: int
    log: int
    rows: NDArray[np.bool_]
    counts: NDArray[np.intp]
    squares: Array
    whole: Array
    values: Array
    zeros: Array


@dataclass(frozen=True)
class HeldOut:
    """What was predicted of parts that were left out.

    Attributes:
        by: whether whole `logs` or `blocks` were left out.
        joints: the names of the joints (njoint).
        parts: of each log in each fold which rows were predicted, and by what.
        simulated: how simulations of each log in each fold ended; none where nothing could be simulated.
    """

    by: str
    joints: tuple[str, ...]
    parts: tuple[LeftOutLog, ...] = field(repr=False)
    simulated: tuple[Motion, ...] = field(repr=False)

    @cached_property
    def missed(self) -> Array:
        """Root mean square of the torque that was not predicted (njoint), in N m or N."""
        return self._usual([part.squares for part in self.parts])

    @cached_property
    def of(self) -> Array:
        """Root mean square of the torque (njoint), in N m or N; of a joint without a motor that of the terms that
        cancel.
        """
        return self._usual([part.whole for part in self.parts])

    def _usual(self, squares: Sequence[Array]) -> Array:
        """The root of the mean over all rows, from the sum of `squares` of each part (njoint each)."""
        count = np.sum([part.counts for part in self.parts], axis=0)
        return np.asarray(np.sqrt(np.sum(squares, axis=0) / np.maximum(count, 1)), dtype=np.float64)

    @cached_property
    def folds(self) -> Array:
        """The relative error of each fold (nfold)."""
        numbers = sorted({part.fold for part in self.parts})
        return np.array([_relative([part for part in self.parts if part.fold == number]) for number in numbers])

    @property
    def angle(self) -> Array:
        """Root mean square error of the angles at the end of simulations (njoint), in rad or m; NaN where there are
        none.
        """
        return np.sqrt(self._mean_squares([each.angle for each in self.simulated]))

    @property
    def constant_speed(self) -> Array:
        """What a constant speed would make of it (njoint)."""
        return np.sqrt(self._mean_squares([each.constant_speed for each in self.simulated]))

    @cached_property
    def motions(self) -> Array:
        """The error of simulated angles in each fold (nfold), root mean square over joints, each as a share of what a
        constant speed makes; none where nothing could be simulated.
        """
        shares = []
        for number in sorted({each.fold for each in self.simulated}):
            own = [each for each in self.simulated if each.fold == number]
            usual = self._mean_squares([each.constant_speed for each in own])
            shares.append(self._mean_squares([each.angle for each in own]) / np.maximum(usual, 1e-300))
        return np.array([np.sqrt(share.mean()) for share in shares])

    def _mean_squares(self, errors: Sequence[Array]) -> Array:
        """Of some errors (nstart x njoint each) of each joint (njoint)."""
        every = np.concatenate(errors) if errors else np.full((1, len(self.joints)), np.nan)
        return np.asarray((every**2).mean(axis=0), dtype=np.float64)

    @property
    def relative(self) -> float:
        """The error of all joints' torques, as a share of what they are, both root mean square."""
        return float(np.linalg.norm(self.missed) / max(float(np.linalg.norm(self.of)), 1e-300))

    def without(self, fold: int) -> float:
        """The same of all folds but one."""
        return _relative([part for part in self.parts if part.fold != fold])

    @property
    def by_joint(self) -> Array:
        """The same of each joint (njoint)."""
        return np.asarray(self.missed / np.maximum(self.of, 1e-300), dtype=np.float64)

    @property
    def motion(self) -> float:
        """The error of simulated angles as a share of what a constant speed makes, the geometric mean of all folds."""
        return float(np.exp(np.log(np.maximum(self.motions, 1e-12)).mean()))

    @property
    def summary(self) -> dict[str, object]:
        """As it is in `metaid estimate --json`: None where nothing could be simulated."""
        rows = zip(self.joints, self.by_joint.tolist(), self.missed.tolist(), self.of.tolist(), strict=True)
        return {
            "by": self.by,
            "torque": {
                "relative": self.relative,
                "joints": [
                    {"name": name, "relative": relative, "rms": rms, "of": of} for name, relative, rms, of in rows
                ],
            },
            "motion": {
                "seconds": AHEAD,
                "angle": [each if np.isfinite(each) else None for each in self.angle.tolist()],
                "constant_speed": [each if np.isfinite(each) else None for each in self.constant_speed.tolist()],
            },
        }


@dataclass(frozen=True)
class Yardstick:
    """The logs on their grids, and what is held out of them; `of_halves` where of a log that is held out the second
    half alone is judged, whether zeros are unknown or not.
    """

    logs: tuple[Smoothed, ...]
    folds: tuple[Fold, ...]
    of_halves: bool = False

    @property
    def by(self) -> str:
        return "logs" if self.folds[0].third is None else "blocks"

    @cached_property
    def _first_halves(self) -> list[Smoothed]:
        """Of each log what tells its zeros, and what passes the filter into it."""
        return [each.until(each.middle + FADES / each.cutoff) for each in self.logs]

    def _rows_of(self, equations: Equations, fold: Fold, log: int) -> NDArray[np.bool_]:
        """Which rows of a log (nrow) a fold judges: with zeros that are or may be unknown its second half alone."""
        own = self.logs[log]
        inside = own.judged & fold.rows(log, own.times)
        if fold.third is None and (equations.zeros or equations.model.is_pendulum or self.of_halves):
            inside &= own.times >= own.middle
        return inside

    def _zeros_of(self, equations: Equations, values: Array, log: int) -> Array:
        """The zeros of a log that was held out (njoint), in rad, from its first half, by unknowns (nparam)."""
        own, model = self._first_halves[log], equations.model
        first = own.judged & (own.times < self.logs[log].middle)
        zeros = np.zeros(model.njoint)
        shifts = SHIFT * np.vstack([zeros, np.eye(model.njoint)])
        sent = own.acting(equations.delay)
        for _ in range(ZERO_STEPS):
            usual, *moved = own.predicted(model, values, zeros + shifts)[:, first]
            left = sent[first] - usual
            spread = np.sqrt((left**2).mean(axis=0)) + 1e-12
            rows = np.stack([((each - usual) / SHIFT / spread).ravel() for each in moved], axis=1)
            # neighbours through the filter are no readings of their own
            correlated = max(1.0, 1.0 / (2.0 * own.cutoff * own.period))
            gram = rows.T @ rows / correlated + np.eye(model.njoint) / ZERO**2
            zeros = zeros + np.linalg.solve(gram, rows.T @ (left / spread).ravel() / correlated - zeros / ZERO**2)
        return zeros

    def judged(self, equations: Equations, solutions: Sequence[Solution], most: int = 0) -> HeldOut:
        """How well each fold is predicted by a solution of its own (nfold); its motion, too, by so many simulations a
        fold at most.
        """
        return self.all_judged([(equations, solutions)], most)[0]

    def all_judged(self, candidates: Sequence[tuple[Equations, Sequence[Solution]]], most: int) -> list[HeldOut]:
        """The same of several equations with their solutions. Those that have a delay in common, and a model but for
        its friction, are simulated side by side, which takes little longer than one of them.
        """
        predicted = [self._predicted(*each) for each in candidates]
        alike: dict[tuple[int, float, float], list[tuple[int, Begun]]] = {}
        for number, (equations, _) in enumerate(candidates):
            if not most or equations.model.untrusted.any():  # by an unknown torque nothing can be simulated
                continue
            for part in predicted[number]:
                own = self.logs[part.log]
                starts = starts_of(own, part.rows, max(4, most // len(self.folds[part.fold].logs)))
                if len(starts):
                    # of one grid but for rounding, and of bodies that are unknown in the same way
                    key = id(equations.model.dynamics), equations.delay, round(own.period, 9)
                    begun = Begun(part.fold, equations.model, own, starts, part.values, part.zeros)
                    alike.setdefault(key, []).append((number, begun))
        moved: list[list[Motion]] = [[] for _ in candidates]
        for every in alike.values():
            equations, _ = candidates[every[0][0]]
            ended = simulated([begun for _, begun in every], equations.delay)
            for (number, _), motion in zip(every, ended, strict=True):
                moved[number].append(motion)
        return [
            HeldOut(self.by, equations.model.joints, parts, tuple(motions))
            for (equations, _), parts, motions in zip(candidates, predicted, moved, strict=True)
        ]

    def _predicted(self, equations: Equations, solutions: Sequence[Solution]) -> tuple[LeftOutLog, ...]:
        """Torques of all folds, each by a solution of its own."""
        model, parts = equations.model, []
        for number, (fold, solution) in enumerate(zip(self.folds, solutions, strict=True)):
            for log in fold.logs:
                own, zeros = self.logs[log], solution.zeros[log]
                if equations.zeros and fold.third is None:
                    zeros = self._zeros_of(equations, solution.values, log)
                rows, sent = self._rows_of(equations, fold, log), own.acting(equations.delay)
                left = sent - own.predicted(model, solution.values, zeros)
                squares = own.squares(model, solution.values[: model.nbody], sent, left, rows)
                counts = rows.sum() * ~own.held
                parts.append(LeftOutLog(number, log, rows, counts, *squares, solution.values, zeros))
        return tuple(parts)


def _relative(parts: Sequence[LeftOutLog]) -> float:
    """The error of some parts together, as a share of what the torques are."""
    whole = sum(float(part.whole.sum()) for part in parts)
    return float(np.sqrt(sum(float(part.squares.sum()) for part in parts) / max(whole, 1e-300)))
