"""What is chosen by the error on parts that were left out: windows, friction, zeros, delay, and the prior's width.

One yardstick serves for all choices: the torque of what was left out, through the same filter (Eq. 73), and of
pendulums, which move freely, the angles at the end of short simulations. A term is taken up where it lowers the error
by WORTH, of all joints together or of a joint on average, never by its own significance alone.  Eq. 72.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from metaid.models import Array
from metaid.recorded.comparing import Candidate, Search
from metaid.recorded.friction_terms import with_friction, with_springs, without_needless
from metaid.recorded.held_out import Yardstick
from metaid.recorded.weak_form.cutting import DEGREES
from metaid.recorded.weak_form.equations import Equations, Solution, first_equations
from metaid.recorded.weak_form.folds import folds_of
from metaid.recorded.weak_form.linear_model import BASE, LinearModel
from metaid.recorded.weak_form.possible import Possible
from metaid.recorded.weak_form.smoothed import CUTOFFS, Smoothed

ALIKE = 1.005  # times the least error: of windows that predict alike the finest tell most
DELAYS = np.arange(-0.040, 0.0401, 0.002)  # s
DOUBTS = (3.0, 10.0, 30.0)  # times the deviations of the bodies' prior
GUESSED = 0.85  # of the error: a wider prior that leaves more is not tried on possible bodies
PROMPT = 0.002  # s: a delay as of a control step is looked for before friction is, which a longer one looks like
SLOW = 0.01  # of a joint's usual speed: below it dry friction is a share of its whole
USUAL = 0.3  # s: the windows that the cut-off of the yardstick is chosen with are no longer
NEARLY = 1.25  # times the least error


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
        search: what it was chosen from.
        delay_at_bound: whether the scan of delays ended at its end.
    """

    equations: Equations
    search: Search
    delay_at_bound: bool

    @property
    def yardstick(self) -> Yardstick:
        """What is held out."""
        return self.search.yardstick

    @property
    def tried(self) -> Sequence[tuple[str, float]]:
        """What was tried, in words, and by which the error of what was left out changed (1: not at all)."""
        return self.search.tried

    def turned(self, model: LinearModel) -> Chosen:
        """The same of a robot whose frames have the zeros that all logs share, without other zeros where these are not
        worth their while.
        """
        without = replace(self.equations.with_model(model), zeros=False)
        best = _with_zeros(self.search, self.search.candidate(without), "zeros that logs do not share")
        return replace(self, equations=best.equations)


def choose(logs: Sequence[Smoothed], model: LinearModel, choices: Choices, scale: float) -> Chosen:
    """The windows, terms, zeros and delay that predict best what is left out.

    Args:
        logs: on their grids.
        model: what is unknown, with any terms of friction.
        choices: of the user.
        scale: of the nominal bodies.

    Raises:
        RecordError: the logs have too little of it.
    """
    logs, asked = _with_cutoff(logs, model, choices, scale), choices.friction
    terms = BASE if asked is None else asked
    search = Search(logs, model.with_friction(terms), [*DEGREES] if choices.span is None else [choices.span])
    said = replace(search.by_span[0], zeros=bool(choices.zeros), delay=choices.delay or 0.0, scale=scale)
    best = _best_windows(search, said)
    if choices.delay is None:
        best, _ = _with_delay(search, best, PROMPT)
    if choices.zeros is None:
        best = _with_zeros(search, best)
    best = plain = with_friction(search, best, asked)
    best = _with_doubt(search, best)
    if asked is None:
        best = with_springs(search, best)
    if best is not plain:
        best = with_friction(search, best, asked)
    best = _best_windows(search, best.equations)
    at_bound = False
    if choices.delay is None:  # friction that was taken up may have looked like a delay
        if best.equations.delay:
            best = search.candidate(replace(best.equations, delay=0.0))
        best, at_bound = _with_delay(search, best)
        if asked is None and abs(best.equations.delay) > PROMPT:
            best = _with_friction_anew(search, best)
    if asked is None:
        best = without_needless(search, best)
    search.by_span.clear()  # what they keep of all windows takes memory as long as the result lives
    return Chosen(best.equations, search, at_bound)


def _best_windows(search: Search, like: Equations) -> Candidate:
    """The finest windows that predict nearly as well as any. How heavy the bodies of joints without a motor are is told
    by the torques of the others, which count beside the motion of a pendulum.
    """
    every = search.candidates([each.with_choices_of(like) for each in search.by_span])
    errors = np.array([each.whole for each in every])
    driven = like.driven
    if like.model.is_pendulum and like.model.passive.any() and driven.any():
        errors *= [np.exp(np.log(np.maximum(each.by_joint[driven], 1e-300)).mean()) for each in every]
    good = np.flatnonzero(errors <= ALIKE * np.fmin.reduce(errors))
    return every[good[0] if len(good) else 0]


def _with_zeros(search: Search, best: Candidate, which: str = "zeros of the encoders") -> Candidate:
    """With zeros of the encoders, where these are worth their while; each judged on the same rows."""
    (before,) = search.candidates([best.equations], of_halves=True)
    return search.better(which, replace(best.equations, zeros=True), before) or best


def _with_doubt(search: Search, best: Candidate) -> Candidate:
    """With a wider prior of the bodies, where that is worth its while for those that can be, too: nominal ones may be
    a guess.
    """
    found = search.candidates([replace(best.equations, doubt=doubt) for doubt in DOUBTS])
    for doubt, each in zip(DOUBTS, found, strict=True):
        search.noted(f"a prior {doubt:g} times as wide", each, best)
    wider = min(found, key=lambda each: float(np.prod(each.shares(best))))
    if wider.shares(best)[0] > GUESSED:
        return best

    def possible(equations: Equations) -> list[Solution]:
        bodies = Possible(equations)
        return [bodies.refined(each) for each in equations.without_each]

    before, after = search.candidates([best.equations, wider.equations], solve=possible)
    return wider if after.is_worth(before) else best


def _with_delay(search: Search, best: Candidate, longest: float = np.inf) -> tuple[Candidate, bool]:
    """With a delay of the torques that is no longer than so many s, where it is worth its while, and whether it is an
    end of what was scanned.
    """
    late, at_bound = likely_delay(best.equations)
    if abs(late) > longest:
        return best, False
    found = search.better("a delay", replace(best.equations, delay=late), best)
    return (best, False) if found is None else (found, at_bound)


def _with_friction_anew(search: Search, best: Candidate) -> Candidate:
    """With the friction that is worth its while once the delay is known, where that predicts better: what was taken up
    before may have stood for the delay.
    """
    late = search.model(best, best.model.plain)
    late = _best_windows(search, with_friction(search, late, None).equations)
    late, _ = _with_delay(search, late)
    return late if late.is_worth(best) else best


def likely_delay(present: Equations) -> tuple[float, bool]:
    """The delay of the torques that leaves least, in s, and whether it is an end of the scan."""
    root, njoint = np.linalg.cholesky(present.solution.weight).T, present.model.njoint
    whitened = np.concatenate([(root @ own).reshape(-1, own.shape[-1]) for own in present.columns])
    basis = np.linalg.qr(whitened / np.maximum(np.sqrt((whitened**2).sum(axis=0)), 1e-300))[0]

    def left(delay: float) -> float:
        sent = [part.torques(delay) for part in present.parts]
        target = (np.concatenate([each.reshape(-1, njoint) for each in sent]) @ root.T).ravel()
        return float(target @ target - ((basis.T @ target) ** 2).sum())

    errors = [left(float(delay)) for delay in DELAYS]
    at = int(np.argmin(errors))
    if at in (0, len(DELAYS) - 1):
        return float(DELAYS[at]), True
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(left, bounds=(DELAYS[at - 1], DELAYS[at + 1]), method="bounded", options={"xatol": 1e-6})
    return float(found.x), False


def _with_cutoff(logs: Sequence[Smoothed], model: LinearModel, choices: Choices, scale: float) -> tuple[Smoothed, ...]:
    """The logs with the highest cut-off of the torques' filter at which what is left out is predicted nearly as well as
    with any: above it there is noise of the angles, differentiated twice, and no motion that a model could explain.

    Args:
        logs: on their grids.
        model: what is unknown.
        choices: of the user.
        scale: of the nominal bodies.
    """
    spans = [span for span in sorted(DEGREES, reverse=True) if span <= USUAL]
    equations = first_equations(logs, model.with_friction(BASE), spans)
    if equations is None:
        return tuple(logs)
    folds = folds_of(logs, equations.middles)
    zeros = model.is_pendulum and choices.zeros is not False
    equations = replace(equations, zeros=zeros, scale=scale, folds=folds)
    errors = {}
    for cutoff in CUTOFFS:
        filtered = tuple(replace(own, cutoff=cutoff) for own in logs)
        errors[cutoff] = Yardstick(filtered, folds).judged(equations, equations.without_each).relative
    best = min(errors.values())
    highest = next(cutoff for cutoff, error in errors.items() if error <= NEARLY * best)
    return tuple(replace(own, cutoff=highest) for own in logs)


def usual_still(logs: Sequence[Smoothed]) -> Array:
    """Below which speed of each joint (njoint) dry friction is a share of its whole, in rad/s or m/s."""
    squares = np.mean([(own.speeds**2).mean(axis=0) for own in logs], axis=0)
    usual = np.sqrt(squares)
    return np.asarray(np.where(usual > 0.0, SLOW * usual, 1.0), dtype=np.float64)
