"""Windows of several logs as linear equations, and the unknowns that solve them.

Every log has unknowns of its own, the zeros of its encoders: nuisance parameters with a prior, which are eliminated log
by log (a Schur complement). Joints are weighed by the covariance of what is left, which is found in a few rounds.
Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.weak_form.cutting import cut_windows
from metaid.recorded.weak_form.folds import THIRDS, Fold
from metaid.recorded.weak_form.linear_model import LinearModel
from metaid.recorded.weak_form.normal import ZERO, Blocks, eliminated, eliminated_covariance, prior_of, solved
from metaid.recorded.weak_form.passive import as_accelerations, own_inertias, share_of_step
from metaid.recorded.weak_form.smoothed import Smoothed
from metaid.recorded.weak_form.windows import LogWindows, loads_of

LASTS = 0.3  # s: how long an error of the model lasts at least
MIDDLE = (0.2, 0.1, 0.3, 0.06, 0.5)  # s: lengths of windows, the first that fit
ROUNDS = 3  # of the covariance across joints
PASSES = 3  # of Newton's steps for zeros and for the friction that grows with load
LEAST = 1e-9  # of the largest torque, that any joint's error is at least: rounding
PASSIVE, LEAST_PASSIVE = 0.1, 1e-3  # of the terms that cancel in a joint without a motor: its error, and the least
UNTRUSTED = 1e12  # times the largest torque, squared: the variance of one that is not trusted


@dataclass(frozen=True)
class Solution:
    """What solves the equations of some windows.

    Attributes:
        values: the unknowns (nparam).
        precision: of them, were the rows independent (nparam x nparam), zeros eliminated.
        prior: the part of it that was there beforehand (nparam x nparam).
        zeros: of the encoders of each log (nlog x njoint), in rad.
        weight: the inverse of the covariance of what is left of a torque (njoint x njoint).
    """

    values: Array
    precision: Array
    prior: Array
    zeros: Array
    weight: Array


@dataclass(frozen=True)
class Equations:
    """The equations of all windows of one length.

    Attributes:
        parts: the windows of each log.
        model: what is unknown.
        zeros: whether the zeros of the encoders are unknown.
        delay: by which torques act later than they are logged, in s.
        scale: of the nominal bodies: by which all torques of the logs differ from theirs.
        doubt: how many times the deviations of the bodies' prior are what they are said to be.
        nlog: how many logs there are, those included that have no part.
        folds: what is held out in turn.
    """

    parts: tuple[LogWindows, ...]
    model: LinearModel
    zeros: bool = False
    delay: float = 0.0
    scale: float = 1.0
    doubt: float = 1.0
    nlog: int = 1
    folds: tuple[Fold, ...] = ()

    @cached_property
    def torques(self) -> list[Array]:
        """The averaged torques (nwindow x ntest x njoint) of each log."""
        return [part.torques(self.delay) for part in self.parts]

    @property
    def nwindow(self) -> int:
        return sum(map(len, self.parts))

    @property
    def covered(self) -> float:
        """How long the windows of all logs are, without what two of them share, in s."""
        return float(sum(len(part) * part.apart for part in self.parts))

    @property
    def middles(self) -> list[Array]:
        """When the windows of each log are half over (nwindow), in s."""
        return [part.middles for part in self.parts]

    @property
    def finest(self) -> LogWindows:
        """The shortest windows: those of a log that is read rarely are longer."""
        return min(self.parts, key=lambda part: part.span)

    @property
    def fastest(self) -> Array:
        """The speed of each joint (njoint) that it hardly exceeds in the logs, in rad/s or m/s."""
        return np.asarray(np.max([part.smoothed.fastest for part in self.parts], axis=0), dtype=np.float64)

    @property
    def span(self) -> float:
        """The length of the windows, in s."""
        return self.finest.span

    def with_model(self, model: LinearModel) -> Equations:
        return replace(self, model=model)

    def with_choices_of(self, other: Equations) -> Equations:
        """The same windows with all that was chosen beside them."""
        return replace(other, parts=self.parts, nlog=self.nlog, folds=self.folds)

    @property
    def solution(self) -> Solution:
        """What solves the equations of all windows.  Eq. 68."""
        return self._solved[0]

    @property
    def columns(self) -> list[Array]:
        """The averaged torque for a unit of each unknown, at the solution, of each log (nwindow x ntest x njoint x
        nparam).
        """
        return [rows[..., : len(self.model.names)] for rows in self._solved[1]]

    @property
    def blocks(self) -> Blocks:
        """The normal equations of each block, at the solution."""
        return self._solved[2]

    def left(self, values: Array) -> list[Array]:
        """What unknowns (nparam) leave of the averaged torques of each log (nwindow x ntest x njoint), without what
        zeros explain.
        """
        return [torques - own @ values for own, torques in zip(self.columns, self.torques, strict=True)]

    @property
    def is_solved(self) -> bool:
        """Whether they have a solution: of a motor that turns with two joints the rotor may be told from no body where
        nothing is left of the torques.
        """
        try:
            return bool(self._solved)
        except np.linalg.LinAlgError:
            return False

    @cached_property
    def _solved(self) -> tuple[Solution, list[Array], Blocks]:
        """The solution, the rows that it was found with (one array a log, nwindow x ntest x njoint x nparam + njoint),
        and the normal equations of its blocks.
        """
        model, n = self.model, self.model.njoint
        nparam = len(model.names)
        nominal = values = self.prior_mean
        zeros = np.zeros((self.nlog, n))
        largest = max(float(np.abs(torques).max()) for torques in self.torques) or 1.0
        every = np.concatenate([torques.reshape(-1, n) for torques in self.torques])
        usual, least = self._usual_errors(every, largest)
        size = float(np.sqrt((every**2).mean())) or float(np.sqrt(self._terms(nominal[: model.nbody]).mean()))
        unknown = model.untrusted, UNTRUSTED * largest**2  # has next to no weight
        covariance, floor = _apart(np.diag(usual), *unknown), np.diag(least)
        passes = PASSES if self.zeros or "load" in model.friction else 1
        for step in range(passes):
            with_zeros = self.zeros and step > 0
            loads = loads_of(self.parts, model, values[: model.nbody], zeros)
            rows = [self._rows(*each, values, zeros, with_zeros) for each in zip(self.parts, loads, strict=True)]
            prior = prior_of(model, rows, size, self.doubt * self.scale)
            for _ in range(ROUNDS):
                weight = np.asarray(np.linalg.inv(covariance + floor), dtype=np.float64)
                blocks, before = self._blocks(rows, values, weight), values
                values, changes, precision = eliminated(blocks, nominal, prior, zeros, with_zeros)
                if model.passive.any():
                    values = before + share_of_step(before, values, self._inertias) * (values - before)
                left = self._left(rows, values, changes)
                covariance = left.T @ left / len(left)
                covariance = _apart(covariance, self.held, float(np.diag(covariance).max()))
                covariance = _apart(covariance, *unknown)
            zeros = zeros + changes
        solution = Solution(values[:nparam], precision, prior, zeros, weight)
        return solution, rows, blocks

    def _usual_errors(self, torques: Array, largest: float) -> tuple[Array, Array]:
        """The variances of averaged `torques` (nrow x njoint) to begin with, and the least that they may be (njoint
        each), by the `largest` of these, or in a joint without a motor by the terms that cancel.
        """
        usual = np.maximum((torques**2).mean(axis=0), LEAST * largest**2)
        terms = np.where(self.model.passive, self._terms(self.scale * self.model.nominal), 0.0)
        return np.maximum(PASSIVE**2 * terms, usual), np.maximum(LEAST_PASSIVE**2 * terms, (LEAST * largest) ** 2)

    def _terms(self, bodies: Array) -> Array:
        """The mean squares of the torques (njoint), of joints without a motor those of the terms that cancel, by bodies
        (nbody).
        """
        every = zip(self.parts, self.torques, strict=True)
        squares = [part.whole(self.model, bodies, torques).mean(axis=(0, 1)) for part, torques in every]
        return np.asarray(np.mean(squares, axis=0), dtype=np.float64)

    @cached_property
    def _inertias(self) -> Array:
        return own_inertias(self.model, self.parts)

    @cached_property
    def held(self) -> NDArray[np.bool_]:
        """Which joints (njoint) are held in all windows: stiction bears what their torques do not show."""
        reaches = [np.ptp(part.coordinates, axis=(0, 1)) for part in self.parts]
        return self.model.held(np.max(reaches, axis=0))

    @property
    def driven(self) -> NDArray[np.bool_]:
        """Which joints (njoint) have a motor whose torques say what moves them."""
        return ~(self.model.untrusted | self.model.passive | self.held)

    def without(self, *folds: int) -> Solution:
        """The solution without the folds of these numbers, by the columns and weights of all."""
        solution, fewer = self.solution, self.blocks.without(*folds)
        prior = solution.prior
        values, changes, precision = eliminated(fewer, self.prior_mean, prior, solution.zeros, self.zeros)
        return replace(solution, values=values, precision=precision, zeros=solution.zeros + changes)

    @property
    def without_each(self) -> list[Solution]:
        """The solutions without each fold (nfold), by the columns and weights of all: quick, while something is
        chosen.
        """
        return [self.without(number) for number in range(len(self.folds))]

    @cached_property
    def apart(self) -> list[Solution]:
        """The same by columns and weights of their own."""
        return [self._apart_from(fold).solution for fold in self.folds]

    def _apart_from(self, fold: Fold) -> Equations:
        """The equations of the windows that share no time with a fold."""
        parts = []
        for part in self.parts:
            shared = fold.shared(part)
            if not shared.any():
                parts.append(part)
            elif not shared.all():
                parts.append(part.only(~shared))
        return replace(self, parts=tuple(parts))

    @property
    def prior_mean(self) -> Array:
        """What the unknowns (nparam) are beforehand: nominal bodies, and no friction."""
        mean = np.zeros(len(self.model.names))
        mean[: self.model.nbody] = self.scale * self.model.nominal
        return mean

    def _rows(self, part: LogWindows, load: Array, values: Array, zeros: Array, with_zeros: bool) -> Array:
        model, own_zeros = self.model, zeros[part.log]
        rows = part.rows(model, load, own_zeros)
        columns = np.zeros((*rows.shape[:-1], model.njoint))
        if with_zeros:
            columns = part.zero_columns(model, values, own_zeros)
        return np.concatenate([rows, columns], axis=-1)

    @cached_property
    def _together(self) -> list[tuple[int, NDArray[np.intp], NDArray[np.bool_]]]:
        """Windows that share time with what the same folds hold out: of which part, which of its windows they are, and
        which folds these are (nfold).
        """
        together = []
        for number, part in enumerate(self.parts):
            folds = np.array([fold.shared(part) for fold in self.folds]).reshape(-1, len(part)).T
            kinds, of_kind = np.unique(folds, axis=0, return_inverse=True)
            together += [(number, np.flatnonzero(of_kind == kind), shared) for kind, shared in enumerate(kinds)]
        return together

    def _blocks(self, rows: list[Array], values: Array, weight: Array) -> Blocks:
        torques = self.torques
        if self.model.passive.any():
            rows, torques = as_accelerations(rows, torques, values, self._inertias)
        grams, moments = [], []
        root = np.linalg.cholesky(weight).T
        for number, windows, _ in self._together:
            flat = (root @ rows[number][windows]).reshape(-1, rows[number].shape[-1])
            grams.append(flat.T @ flat)
            moments.append(flat.T @ (torques[number][windows] @ root.T).ravel())
        numbers, _, shared = zip(*self._together, strict=True)
        logs = [self.parts[number].log for number in numbers]
        return Blocks(np.array(grams), np.array(moments), np.array(logs), np.array(shared))

    def _left(self, rows: list[Array], values: Array, changes: Array) -> Array:
        """What is left of the averaged torques (nrow x njoint)."""
        left = [
            torques - own @ np.concatenate([values, changes[part.log]])
            for part, own, torques in zip(self.parts, rows, self.torques, strict=True)
        ]
        return np.concatenate([each.reshape(-1, self.model.njoint) for each in left])

    def beside_zeros(self, torques: Sequence[Array]) -> list[tuple[Array, Array]]:
        """The columns of each log, and some `torques` of it (nwindow x ntest x njoint), both without what zeros
        explain.
        """
        beside = []
        for rows, own in zip(self._solved[1], torques, strict=True):
            columns, of_zeros = np.split(rows, [len(self.model.names)], axis=-1)
            if self.zeros:
                weighed = np.einsum("wajz,jk->wakz", of_zeros, self.solution.weight)
                gram = np.einsum("wakz,waky->zy", weighed, of_zeros) + np.eye(self.model.njoint) / ZERO**2
                columns = columns - of_zeros @ np.linalg.solve(gram, np.einsum("wakz,wakp->zp", weighed, columns))
                own = own - of_zeros @ np.linalg.solve(gram, np.einsum("wakz,wak->z", weighed, own))
            beside.append((columns, own))
        return beside

    @property
    def lags(self) -> int:
        """How many windows an error lasts."""
        return int(np.ceil(max(LASTS, self.span) / max(part.apart for part in self.parts)))

    def covariance(self, values: Array) -> Array:
        """The covariance of the unknowns (nparam x nparam), whatever the errors of a window are, and though those of
        windows that are less than LASTS s apart belong together.  Eq. 70.
        """
        solution, nparam = self.solution, len(values)
        scores, readings = [], 0
        for columns, left in self.beside_zeros(self.left(values)):
            scores.append(np.einsum("wajp,jk,wak->wp", columns, solution.weight, left, optimize=True))
            readings += left.size
        inverse = solved(solution.precision, np.eye(nparam))
        few = readings / max(readings - nparam, 1)
        return few * eliminated_covariance(inverse, scores, self.lags) + inverse @ solution.prior @ inverse


def _apart(covariance: Array, which: NDArray[np.bool_], variance: float) -> Array:
    """A covariance (njoint x njoint) where `which` joints (njoint) have this variance and none with others."""
    return np.where(np.outer(~which, ~which), covariance, variance * np.diag(which.astype(float)))


def equations_of(logs: Sequence[Smoothed], model: LinearModel, span: float) -> Equations | None:
    """The equations of windows of one length, in s; None where a log has no such windows in which it moves, or there
    are too few of all: a few times as many rows as unknowns are enough with two thirds of them, too.
    """
    parts = []
    for log, own in enumerate(logs):
        windows = cut_windows(log, own, span)
        if windows is None or len(windows) < THIRDS:
            return None
        parts.append(windows)
    equations = Equations(tuple(parts), model, nlog=len(parts))
    is_enough = 2 * equations.nwindow * model.njoint >= 3 * len(model.names)
    return equations if is_enough else None


def first_equations(logs: Sequence[Smoothed], model: LinearModel, spans: Iterable[float] = MIDDLE) -> Equations | None:
    """The equations of the first windows, by their length in s, that all logs have enough of; None where there are
    none.
    """
    tried = (equations_of(logs, model, span) for span in spans)
    return next((equations for equations in tried if equations is not None), None)
