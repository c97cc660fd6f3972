"""What is chosen by the error on parts that were left out: windows, terms of friction, zeros, and the delay.

One yardstick serves for all choices: the torque of what was left out, through the same filter (Eq. 73), and of
pendulums, which move freely, the angles at the end of short simulations. A term is taken up where it lowers the error
by WORTH, never by its own significance alone.  Eq. 72.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from metaid.errors import RecordError
from metaid.models import Array
from metaid.models.tree import COLUMNS
from metaid.recorded.held_out import Yardstick
from metaid.recorded.reading.log import Record
from metaid.recorded.weak_form.equations import Equations, equations_of
from metaid.recorded.weak_form.folds import folds_of
from metaid.recorded.weak_form.linear_model import LinearModel
from metaid.recorded.weak_form.smoothed import CUTOFFS, Smoothed

# Length in s and degree of polynomials, the finest first.
WINDOWS = ((0.06, 4), (0.1, 5), (0.15, 4), (0.2, 6), (0.25, 4), (0.35, 4), (0.3, 8), (0.5, 10))
BASE = ("viscous", "coulomb")
PRESLIDING = (1e-4, 3e-4, 1e-3, 3e-3)  # rad or m, of all joints alike
FINER = (0.3, 0.55, 1.0, 1.8, 3.3, 6.0, 10.0)  # times that, of each joint by itself
ALIKE = 1.005  # times the least error: of windows that predict alike the finest tell most
WORTH = 0.97  # of the error: a term that leaves more is not taken up
DELAYS = np.arange(-0.040, 0.0401, 0.002)  # s
PROMPT = 0.002  # s: a delay as of a control step is looked for before friction is, which a longer one looks like
SLOW = 0.01  # of a joint's usual speed: below it dry friction is a share of its whole
USUAL = 0.3  # s: the windows that the cut-off of the yardstick is chosen with are no longer
NEARLY = 1.25  # times the least error
STARTS = 24  # of simulations a fold, while something is chosen


@dataclass(frozen=True)
class Choices:
    """What the user chose; None where metaid is to.

    Attributes:
        span: length of the windows, in s.
        delay: of the torques, in s.
        friction: terms of every joint.
        zeros: whether encoders have zeros of their own in each log.
    """

    span: float | None = None
    delay: float | None = None
    friction: tuple[str, ...] | None = None
    zeros: bool | None = None


@dataclass(frozen=True)
class Chosen:
    """What was chosen.

    Attributes:
        equations: of all windows, with what was chosen.
        yardstick: what is held out.
        tried: what was tried, in words, and by which the error of what was left out changed (1: not at all).
        delay_at_bound: whether the scan of delays ended at its end.
    """

    equations: Equations
    yardstick: Yardstick
    tried: tuple[tuple[str, float], ...]
    delay_at_bound: bool


class _Search:
    """Equations by windows, and the error of each choice."""

    def __init__(
        self,
        records: Sequence[Record],
        logs: Sequence[Smoothed],
        model: LinearModel,
        spans: Sequence[tuple[float, int]],
    ) -> None:
        self._by_windows = {}
        for span, power in spans:
            equations = equations_of(records, logs, model, span, power)
            if equations is not None:
                self._by_windows[span, power] = equations
        if not self._by_windows:
            names = ", ".join(record.name for record in records)
            raise RecordError(
                f"{names}: too short for {len(model.names)} unknowns, or read too rarely "
                f"(allowed: more motion, or fewer terms of friction)"
            )
        first = next(iter(self._by_windows.values()))
        self.yardstick = Yardstick(tuple(logs), folds_of(logs, first.middles))
        self._by_windows = {key: replace(each, folds=self.yardstick.folds) for key, each in self._by_windows.items()}
        self.tried: list[tuple[str, float]] = []

    def equations(self, windows: tuple[float, int], like: Equations) -> Equations:
        """Those of other windows, with the choices of others."""
        own = self._by_windows[windows]
        return replace(own, model=like.model, zeros=like.zeros, delay=like.delay, scale=like.scale)

    @property
    def windows(self) -> list[tuple[float, int]]:
        return list(self._by_windows)

    def errors(self, candidates: Sequence[Equations]) -> list[tuple[float, Array]]:
        """Of each of several equations that of what is left out, and that of each joint's torque (njoint)."""
        model = candidates[0].model
        swings, unsolved = model.is_pendulum, (float("inf"), np.full(model.njoint, np.inf))
        solved = {}
        for number, each in enumerate(candidates):
            with suppress(np.linalg.LinAlgError):
                solved[number] = each, self.yardstick.solutions(each)
        held = self.yardstick.all_judged(list(solved.values()), with_motion=swings, most=STARTS)
        found = {
            number: (each.motion if swings and len(each.motions) else each.relative, each.by_joint)
            for number, each in zip(solved, held, strict=True)
        }
        return [found.get(number, unsolved) for number in range(len(candidates))]

    def error(self, equations: Equations) -> float:
        """That of what is left out."""
        return self.errors([equations])[0][0]

    def better(self, what: str, other: Equations, error: float) -> float | None:
        """The error of another choice where it is worth its while; None where it is not."""
        found = self.error(other)
        self.tried.append((what, found / max(error, 1e-300)))
        return found if found < WORTH * error and error > 0.0 else None


def choose(
    records: Sequence[Record],
    logs: Sequence[Smoothed],
    model: LinearModel,
    choices: Choices,
    scale: float = 1.0,
) -> Chosen:
    """The windows, terms, zeros and delay that predict best what is left out.

    Args:
        records: the logs.
        logs: the same on their grids.
        model: what is unknown, with any terms of friction.
        choices: of the user.
        scale: of the nominal bodies.

    Raises:
        RecordError: the logs have too little of it.
    """
    asked = choices.friction
    terms = BASE if asked is None else tuple(term for term in COLUMNS if term in asked)
    spans = WINDOWS if choices.span is None else ((choices.span, _usual_power(choices.span)),)
    search = _Search(records, logs, model.with_friction(terms), spans)
    present = replace(
        search.equations(search.windows[0], next(iter(search._by_windows.values()))),
        zeros=bool(choices.zeros),
        delay=choices.delay or 0.0,
        scale=scale,
    )
    present, error = _best_windows(search, present)
    if choices.delay is None:
        present, error, _ = _with_delay(search, present, error, PROMPT)
    if choices.zeros is None:
        present, error = _with_zeros(search, present, error)
    present, error = _with_friction(search, present, error, asked)
    present, error = _best_windows(search, present)
    at_bound = False
    if choices.delay is None:  # friction that was taken up may have looked like a delay
        prompt = replace(present, delay=0.0)
        present, error, at_bound = _with_delay(search, prompt, search.error(prompt) if present.delay else error)
    return Chosen(present, search.yardstick, tuple(search.tried), at_bound)


def _usual_power(span: float) -> int:
    """The degree of the polynomials of windows whose length, in s, the user has said."""
    return min(WINDOWS, key=lambda windows: abs(np.log(windows[0] / span)))[1]


def _best_windows(search: _Search, present: Equations) -> tuple[Equations, float]:
    every = [search.equations(windows, present) for windows in search.windows]
    errors = [error for error, _ in search.errors(every)]
    most = ALIKE * np.fmin.reduce(errors)
    best = next((number for number, error in enumerate(errors) if error <= most), 0)
    return every[best], errors[best]


def _with_zeros(search: _Search, present: Equations, error: float) -> tuple[Equations, float]:
    """With zeros of the encoders, where these are worth their while; each judged on the same rows."""
    other = replace(present, zeros=True)
    found = search.better("zeros of the encoders", other, error)
    return (present, error) if found is None else (other, found)


def _with_friction(
    search: _Search, present: Equations, error: float, asked: tuple[str, ...] | None
) -> tuple[Equations, float]:
    """With the terms of friction that are worth their while, one after the other, the best first."""
    model = present.model
    while True:
        free = [term for term in COLUMNS if asked is None and term not in model.friction]
        candidates = [(term, model.with_friction((*model.friction, term), model.sliding.presliding)) for term in free]
        if not model.sliding.builds_up and (asked is None or "hysteresis" in asked):
            candidates += [
                (f"hysteresis, δ = {size:g}", model.with_friction(model.friction, size)) for size in PRESLIDING
            ]
        best: tuple[float, LinearModel] | None = None
        must = asked is not None and "hysteresis" in asked and not model.sliding.builds_up
        for what, each in candidates:
            other = present.with_model(each)
            if must:
                found: float | None = search.error(other)
            else:
                found = search.better(what, other, error)
            if found is not None and (best is None or found < best[0]):
                best = found, each
        if best is None:
            break
        error, model = best
        present = present.with_model(model)
    if model.sliding.builds_up:
        present, error = _finer_presliding(search, present, error)
    return present, error


def _finer_presliding(search: _Search, present: Equations, error: float) -> tuple[Equations, float]:
    """With the displacement over which the friction of each joint builds up: of those that predict its own torque as
    well, to WORTH, the longest, which is the gentlest to simulate.
    """
    model, factors = present.model, np.array(FINER)
    common = model.sliding.presliding

    def with_presliding(presliding: Array) -> Equations:
        return present.with_model(model.with_friction(model.friction, presliding))

    by_joint = np.array([own for _, own in search.errors([with_presliding(factor * common) for factor in factors])])
    is_as_good = WORTH * by_joint <= by_joint.min(axis=0)
    other = with_presliding(common * np.where(is_as_good, factors[:, None], 0.0).max(axis=0))
    found = search.error(other)
    return (other, found) if WORTH * found <= error else (present, error)


def _with_delay(
    search: _Search, present: Equations, error: float, longest: float = np.inf
) -> tuple[Equations, float, bool]:
    """With a delay of the torques that is no longer than so many s, where it is worth its while, and whether it is an
    end of what was scanned.
    """
    late, at_bound = likely_delay(present)
    if abs(late) > longest:
        return present, error, False
    other = replace(present, delay=late)
    found = search.better("a delay", other, error)
    return (present, error, False) if found is None else (other, found, at_bound)


def likely_delay(present: Equations) -> tuple[float, bool]:
    """The delay of the torques that leaves least, in s, and whether it is an end of the scan."""
    solution, rows, _ = present.solved
    root, njoint, nparam = np.linalg.cholesky(solution.weight).T, present.model.njoint, len(solution.values)
    whitened = np.concatenate([(root @ own[..., :nparam]).reshape(-1, nparam) for own in rows])
    basis = np.linalg.qr(whitened / np.maximum(np.sqrt((whitened**2).sum(axis=0)), 1e-300))[0]

    def left(delay: float) -> float:
        sent = [part.windows.torques(part.record, delay) for part in present.parts]
        target = (np.concatenate([each.reshape(-1, njoint) for each in sent]) @ root.T).ravel()
        return float(target @ target - ((basis.T @ target) ** 2).sum())

    errors = [left(float(delay)) for delay in DELAYS]
    at = int(np.argmin(errors))
    if at in (0, len(DELAYS) - 1):
        return float(DELAYS[at]), True
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(left, bounds=(DELAYS[at - 1], DELAYS[at + 1]), method="bounded", options={"xatol": 1e-6})
    return float(found.x), False


def with_cutoff(
    records: Sequence[Record], logs: Sequence[Smoothed], model: LinearModel, zeros: bool, scale: float
) -> tuple[Smoothed, ...]:
    """The logs with the highest cut-off of the torques' filter at which what is left out is predicted nearly as well as
    with any: above it there is noise of the angles, differentiated twice, and no motion that a model could explain.

    Args:
        records: the logs.
        logs: the same on their grids.
        model: what is unknown.
        zeros: whether those of the encoders are unknown.
        scale: of all torques.
    """
    for span, power in sorted(WINDOWS, reverse=True):
        equations = equations_of(records, logs, model.with_friction(BASE), span, power)
        if equations is not None and span <= USUAL:
            break
    if equations is None:
        return tuple(logs)
    folds = folds_of(logs, equations.middles)
    equations = replace(equations, zeros=zeros, scale=scale, folds=folds)
    errors = {}
    for cutoff in CUTOFFS:
        filtered = tuple(replace(own, cutoff=cutoff) for own in logs)
        errors[cutoff] = Yardstick(filtered, folds).held_out(equations).relative
    best = min(errors.values())
    highest = next(cutoff for cutoff, error in errors.items() if error <= NEARLY * best)
    return tuple(replace(own, cutoff=highest) for own in logs)


def usual_still(logs: Sequence[Smoothed]) -> Array:
    """Below which speed of each joint (njoint) dry friction is a share of its whole, in rad/s or m/s."""
    squares = np.mean([(own.speeds**2).mean(axis=0) for own in logs], axis=0)
    usual = np.sqrt(squares)
    return np.asarray(np.where(usual > 0.0, SLOW * usual, 1.0), dtype=np.float64)


def fastest(logs: Sequence[Smoothed]) -> Array:
    """The speed of each joint (njoint) that it hardly exceeds, in rad/s or m/s."""
    each = [np.quantile(np.abs(own.speeds), 0.99, axis=0) for own in logs]
    return np.asarray(np.max(each, axis=0), dtype=np.float64)
