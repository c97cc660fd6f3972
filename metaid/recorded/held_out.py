"""How well what some parts of the logs say predicts the parts that were left out: of torques, and of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.motion import AHEAD, Begun, simulated, starts_of
from metaid.recorded.weak_form.equations import Equations, Fold, Solution
from metaid.recorded.weak_form.linear_model import LinearModel
from metaid.recorded.weak_form.normal import ZERO, block_edges
from metaid.recorded.weak_form.smoothed import Smoothed

MOST_FOLDS = 8  # logs are held out in so many groups at most
WHOLE = 3  # so many logs or more: whole ones are held out
MOST_STARTS = 60  # of simulations a fold
ZERO_STEPS = 3  # of Newton's, for the zeros of a log that was held out


@dataclass(frozen=True)
class HeldOut:
    """What was predicted of parts that were left out.

    Attributes:
        by: whether whole `logs` or `blocks` were left out.
        joints: the names of the joints (njoint).
        missed: root mean square of the torque that was not predicted (njoint), in N m or N.
        of: root mean square of the torque (njoint), in N m or N.
        folds: the relative error of each fold (nfold).
        seconds: how long simulations were.
        angle: root mean square error of the angles at their end (njoint), in rad or m.
        constant_speed: what a constant speed would make of it (njoint).
        motions: error of each fold (nfold), root mean square over joints, each as a share of what a constant speed
            makes.
    """

    by: str
    joints: tuple[str, ...]
    missed: Array
    of: Array
    folds: Array
    seconds: float
    angle: Array
    constant_speed: Array
    motions: Array

    @property
    def relative(self) -> float:
        """The error of all joints' torques, as a share of what they are, both root mean square."""
        return float(np.linalg.norm(self.missed) / max(float(np.linalg.norm(self.of)), 1e-300))

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
                "seconds": self.seconds,
                "angle": [each if np.isfinite(each) else None for each in self.angle.tolist()],
                "constant_speed": [each if np.isfinite(each) else None for each in self.constant_speed.tolist()],
            },
        }


@dataclass(frozen=True)
class Yardstick:
    """The logs on their grids, and what is held out of them."""

    logs: tuple[Smoothed, ...]
    folds: tuple[Fold, ...]

    @property
    def by(self) -> str:
        return "logs" if self.folds[0].third is None else "blocks"

    @cached_property
    def _bodies(self) -> dict[tuple[int, bytes], Array]:
        return {}

    def at_rows(self, model: LinearModel, log: int, zeros: Array) -> Array:
        """The torque at the rows of a log (nrow x njoint x nbody) for a unit of each of the bodies' unknowns."""
        key = log, zeros.tobytes()
        if key not in self._bodies:
            own = self.logs[log]
            if zeros.any():
                return model.bodies(own.coordinates + zeros, own.speeds, own.accelerations)
            self._bodies[key] = model.bodies(own.coordinates, own.speeds, own.accelerations)
        return self._bodies[key]

    def predicted(self, model: LinearModel, values: Array, log: int, zeros: Array) -> Array:
        """The torques of a log (nrow x njoint), through the filter.

        Args:
            model: what is unknown.
            values: the unknowns (nparam).
            log: which of the logs.
            zeros: of its encoders (njoint), in rad.
        """
        own = self.logs[log]
        rigid = self.at_rows(model, log, zeros) @ values[: model.nbody]
        columns = model.friction_columns(own.speeds, own.accelerations, own.states(model), rigid)
        return own.filtered(rigid + columns @ values[model.nbody :])

    def sent(self, log: int, delay: float) -> Array:
        """The torques that acted (nrow x njoint), through the filter."""
        own = self.logs[log]
        if not delay:
            return own.torques
        shifted = [np.interp(own.times - delay, own.times, column) for column in own.torques.T]
        return np.stack(shifted, axis=1)

    def rows_of(self, fold: Fold, log: int, second_half: bool) -> NDArray[np.bool_]:
        """Which rows of a log (nrow) a fold judges: with unknown zeros the second half of it alone."""
        own = self.logs[log]
        inside = own.judged & (own.times >= fold.begin) & (own.times < fold.end)
        if second_half and fold.third is None:
            inside &= own.times >= _middle(own)
        return inside

    def zeros_of(self, model: LinearModel, values: Array, log: int, delay: float) -> Array:
        """The zeros of a log that was held out (njoint), in rad, from its first half.

        Args:
            model: what is unknown.
            values: the unknowns (nparam).
            log: which of the logs.
            delay: by which torques act later than they are logged, in s.
        """
        own = self.logs[log]
        first = own.judged & (own.times < _middle(own))
        zeros = np.zeros(model.njoint)
        sent = self.sent(log, delay)
        for _ in range(ZERO_STEPS):
            usual = self.predicted(model, values, log, zeros)
            left = (sent - usual)[first]
            spread = np.sqrt((left**2).mean(axis=0)) + 1e-12
            columns = []
            for joint in range(model.njoint):
                moved = self.predicted(model, values, log, zeros + 1e-4 * (np.arange(model.njoint) == joint))
                columns.append(((moved - usual)[first] * 1e4 / spread).ravel())
            rows = np.stack(columns, axis=1)
            # neighbours through the filter are no readings of their own
            correlated = max(1.0, 1.0 / (2.0 * own.cutoff * own.period))
            gram = rows.T @ rows / correlated + np.eye(model.njoint) / ZERO**2
            zeros = zeros + np.linalg.solve(gram, rows.T @ (left / spread).ravel() / correlated - zeros / ZERO**2)
        return zeros

    def held_out(self, equations: Equations, with_motion: bool = False, most: int = MOST_STARTS) -> HeldOut:
        """How well each fold is predicted from the others, whose joints are weighed as those of all are: quick, while
        something is chosen.

        Args:
            equations: of all logs.
            with_motion: whether motion is simulated, too.
            most: simulations a fold.
        """
        return self.judged(equations, [equations.without(fold) for fold in self.folds], with_motion, most)

    def judged(
        self, equations: Equations, solutions: Sequence[Solution], with_motion: bool = False, most: int = MOST_STARTS
    ) -> HeldOut:
        """How well each fold is predicted by a solution of its own.

        Args:
            equations: of all logs.
            solutions: one a fold (nfold).
            with_motion: whether motion is simulated, too.
            most: simulations a fold.
        """
        model, delay, n = equations.model, equations.delay, equations.model.njoint
        squares, whole, count = np.zeros(n), np.zeros(n), 0
        folds, begun = [], []
        for number, (fold, solution) in enumerate(zip(self.folds, solutions, strict=True)):
            own_squares, own_whole = np.zeros(n), np.zeros(n)
            for log in fold.logs:
                zeros = solution.zeros[log]
                if equations.zeros and fold.third is None:
                    zeros = self.zeros_of(model, solution.values, log, delay)
                rows = self.rows_of(fold, log, equations.zeros or model.is_chain)
                sent = self.sent(log, delay)[rows]
                left = sent - self.predicted(model, solution.values, log, zeros)[rows]
                own_squares += (left**2).sum(axis=0)
                own_whole += (sent**2).sum(axis=0)
                count += len(left)
                if with_motion:
                    starts = starts_of(self.logs[log], rows, max(4, most // len(fold.logs)))
                    begun.append(Begun(number, self.logs[log], starts, solution.values, zeros))
            squares, whole = squares + own_squares, whole + own_whole
            folds.append(float(np.sqrt(own_squares.sum() / max(own_whole.sum(), 1e-300))))
        ended, unmoved, motions = _simulated(model, delay, [each for each in begun if len(each.starts)])
        return HeldOut(
            by=self.by,
            joints=model.joints,
            missed=np.sqrt(squares / max(count, 1)),
            of=np.sqrt(whole / max(count, 1)),
            folds=np.array(folds),
            seconds=AHEAD,
            angle=np.sqrt((ended**2).mean(axis=0)),
            constant_speed=np.sqrt((unmoved**2).mean(axis=0)),
            motions=motions,
        )


def _simulated(model: LinearModel, delay: float, begun: Sequence[Begun]) -> tuple[Array, Array, Array]:
    """Errors of simulations (nstart x njoint), those of a constant speed, and the error of each fold as a share of
    these, root mean square over joints (nfold); NaN where there are none.
    """
    if not begun:
        nothing = np.full((1, model.njoint), np.nan)
        return nothing, nothing, np.zeros(0)
    ends, constant, owners = [], [], []
    for period in sorted({round(each.own.period, 9) for each in begun}):  # of one grid but for rounding
        own = [each for each in begun if round(each.own.period, 9) == period]
        motion = simulated(model, own, delay)
        ends.append(motion.angle)
        constant.append(motion.constant_speed)
        owners.append(np.repeat([each.fold for each in own], [len(each.starts) for each in own]))
    owner, ended, unmoved = (np.concatenate(each) for each in (owners, ends, constant))
    shares = [
        (ended[owner == fold] ** 2).mean(axis=0) / np.maximum((unmoved[owner == fold] ** 2).mean(axis=0), 1e-300)
        for fold in np.unique(owner)
    ]
    return ended, unmoved, np.sqrt(np.mean(shares, axis=1))


def _middle(own: Smoothed) -> float:
    """When half of the judged rows have passed, in s."""
    times = own.times[own.judged]
    return float(times[len(times) // 2]) if len(times) else float(own.times[len(own.times) // 2])


def folds_of(logs: Sequence[Smoothed], equations: Equations) -> tuple[Fold, ...]:
    """What is held out: whole logs where there are WHOLE or more, else thirds of each."""
    nlog = len(logs)
    if nlog >= WHOLE:
        groups = np.array_split(np.arange(nlog), min(nlog, MOST_FOLDS))
        return tuple(Fold(tuple(group.tolist())) for group in groups)
    folds = []
    for part in equations.parts:
        middles = part.windows.middles
        edges = [float(middles[begin]) for begin, _ in block_edges(len(middles))[2::2]]
        for third, (begin, end) in enumerate(zip([-np.inf, *edges], [*edges, np.inf], strict=True)):
            folds.append(Fold((part.log,), third, begin, end))
    return tuple(folds)
