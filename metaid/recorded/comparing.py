"""What is compared when something is chosen: equations by their windows, and how well they predict what was left
out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.errors import RecordError
from metaid.models import Array
from metaid.recorded.held_out import HeldOut, Yardstick
from metaid.recorded.weak_form.equations import Equations, Solution, equations_of
from metaid.recorded.weak_form.folds import folds_of
from metaid.recorded.weak_form.linear_model import LinearModel
from metaid.recorded.weak_form.smoothed import Smoothed

WORTH = 0.97  # of the error: what leaves more is not taken up
CLEARED = 0.99  # of the error that is left without a term: where that is more, the term stays
STARTS = 24  # of simulations a fold, while something is chosen
COVERED = 0.5  # of the time that any windows cover: where fewer rows were read, short ones have too few


class Candidate(NamedTuple):
    """What may be chosen: its `equations`, and the error of what was left out, of the `whole`, of the torque of each
    joint (njoint), which joints count by themselves (njoint), and of each fold (nfold).
    """

    equations: Equations
    whole: float
    by_joint: Array
    counts: NDArray[np.bool_]
    by_fold: Array

    @property
    def model(self) -> LinearModel:
        return self.equations.model

    def shares(self, before: Candidate, joints: NDArray[np.bool_] | bool = True) -> tuple[float, float]:
        """The error as a share of that `before`: of the whole, and of one of the `joints` (njoint; by default all) in
        the geometric mean.
        """
        counts = self.counts & joints
        own, usual = (np.maximum(each[counts], 1e-300) for each in (self.by_joint, before.by_joint))
        of_joints = float(np.exp(np.log(own / usual).mean())) if len(own) else 1.0
        return self.whole / max(before.whole, 1e-300), of_joints

    def gains(self, before: Candidate) -> NDArray[np.bool_]:
        """Which joints (njoint) are predicted better by WORTH; all where none counts by itself."""
        return np.asarray(self.counts & (self.by_joint < WORTH * before.by_joint) | ~self.counts.any())

    def is_agreed(self, before: Candidate) -> bool:
        """Whether folds are predicted better by more than they differ in that: the mean of the logarithms of their
        errors, as shares of those `before`, is below 0 by a standard error.
        """
        shares = np.log(np.maximum(self.by_fold, 1e-300) / np.maximum(before.by_fold, 1e-300))
        return bool(shares.mean() < -shares.std(ddof=1) / np.sqrt(len(shares)))

    def is_worth(self, before: Candidate, joints: NDArray[np.bool_] | bool = True) -> bool:
        """Whether all joints together are predicted better by WORTH, or one of the `joints` (njoint; by default all) is
        on average, and all are no worse: an arm's wrist is next to nothing of its torque.  Eq. 72.
        """
        whole, of_joints = self.shares(before, joints)
        return before.whole > 0.0 and (whole < WORTH or (of_joints < WORTH and whole <= 1.0))

    def is_cleared(self, before: Candidate) -> bool:
        """Whether all joints together or one on average are predicted better by CLEARED, and neither are worse."""
        shares = self.shares(before)
        return min(shares) < CLEARED and max(shares) <= 1.0


class Search:
    """Equations by the length of their windows (`by_span`), and how well each choice predicts."""

    def __init__(self, logs: Sequence[Smoothed], model: LinearModel, spans: Sequence[float]) -> None:
        """Nothing is chosen yet.  Raises RecordError where logs are too short for windows of any length, in s."""
        every = [each for span in spans if (each := equations_of(logs, model, span)) is not None]
        if not every:
            names = ", ".join(own.record.name for own in logs)
            raise RecordError(
                f"{names}: too short for {len(model.names)} unknowns, or read too rarely "
                f"(allowed: more motion, or fewer terms of friction)"
            )
        least = COVERED * max(each.covered for each in every)
        every = [each for each in every if each.covered >= least]
        folds = folds_of(logs, every[0].middles)
        self.yardstick = Yardstick(tuple(logs), folds)
        self.by_span = [replace(each, folds=folds) for each in every]
        self._starts = STARTS if model.is_pendulum else 0
        self.tried: list[tuple[str, float]] = []

    def candidate(self, equations: Equations) -> Candidate:
        """One that may be chosen."""
        return self.candidates([equations])[0]

    def models(self, like: Candidate, models: Iterable[LinearModel]) -> list[Candidate]:
        """The same windows and choices with other `models`."""
        return self.candidates([like.equations.with_model(model) for model in models])

    def model(self, like: Candidate, model: LinearModel) -> Candidate:
        """The same with one other."""
        return self.models(like, [model])[0]

    def candidates(
        self,
        every: Sequence[Equations],
        of_halves: bool = False,
        solve: Callable[[Equations], list[Solution]] = lambda each: each.without_each,
    ) -> list[Candidate]:
        """Each of several that may be chosen, by what was left out; `of_halves` by the second half of a whole log
        alone, as where zeros are unknown; `solve` says what they tell without each fold (nfold), by default freely.
        """
        yardstick = replace(self.yardstick, of_halves=True) if of_halves else self.yardstick
        solved = {}
        for number, each in enumerate(every):
            with suppress(np.linalg.LinAlgError):
                solved[number] = each, solve(each)
        held = yardstick.all_judged(list(solved.values()), self._starts)
        found = dict(zip(solved, held, strict=True))
        return [_judged(each, found.get(number)) for number, each in enumerate(every)]

    def better(self, what: str, other: Equations, before: Candidate) -> Candidate | None:
        """Another choice, where that is worth its while; else None."""
        found = self.noted(what, self.candidate(other), before)
        return found if found.is_worth(before) else None

    def noted(self, what: str, found: Candidate, before: Candidate) -> Candidate:
        """One that was tried, which is to be told by these words."""
        self.tried.append((what, found.shares(before)[0]))
        return found


def _judged(equations: Equations, held: HeldOut | None) -> Candidate:
    """By what equations leave, of a pendulum by its motion; without bound where they have no solution."""
    model, none_counts = equations.model, np.zeros(equations.model.njoint, dtype=bool)
    if held is None:
        return Candidate(equations, np.inf, np.full(model.njoint, np.inf), none_counts, np.full(1, np.inf))
    if model.is_pendulum and len(held.motions):
        return Candidate(equations, held.motion, held.by_joint, none_counts, held.motions)
    return Candidate(equations, held.relative, held.by_joint, ~(model.untrusted | equations.held), held.folds)
