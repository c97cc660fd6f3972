"""Whether an estimate that does not explain what was seen to the noise is good for something all the same.

No model of a real machine explains all to the noise. One is approximate that predicts pushes that were left out far
better than the nominal model, that a plant can have, and on which parts of the pushes agree (Eq. 39). Its intervals
hold what the misfit and repetition say, and what a force that the model has not would change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from metaid.models import COARSEST, DEVIATIONS, Array, jackknife

MOST = 0.5  # of the numbers, or of the joint torques of an arm: on so many parts of the pushes agree to a tenth
PROBABILITY = 0.975  # below the upper end of a 95 % interval
BETTER = 0.5  # of the nominal model's misfit of pushes that were left out: what is approximate has no more
SURE = 10.0  # in the logarithm of a likelihood: what is as much more likely is so by more than chance


@dataclass(frozen=True)
class Prediction:
    """How well pushes that were held out are predicted by a fit to the others, where the estimate explains all: their
    `misfit`, scaled by what noise and the covariance of that fit explain, which is `below` a number by noise alone.
    """

    misfit: float
    below: float

    @property
    def holds(self) -> bool:
        """Whether they are predicted to the noise."""
        return self.misfit < self.below

    @property
    def description(self) -> str:
        """That they are not, in a sentence."""
        return (
            f"all is explained together, but not pushes that were held out: their misfit is {self.misfit:.3g} "
            f"(predicted: below {self.below:.3g})"
        )


@dataclass(frozen=True)
class HeldOutPushes:
    """What the pushes that are left out say of the fits to the others.

    Attributes:
        misfit: root mean square of what these fits leave of the pushes left out, scaled by what noise explains.
        nominal: the same of the nominal model; inf where it cannot follow.
        unknowns: of each fit (npart x nunknown).
        likelier: where noise of the torques explains what the model leaves, how much more likely the fits make the
            pushes of each part (npart) than the nominal model with such noise does, in the logarithm: inf where that
            cannot follow, −inf where the fit cannot; else None.
    """

    misfit: float
    nominal: float
    unknowns: Array
    likelier: Array | None = None

    @property
    def ratio(self) -> float:
        """The logarithm of how much more likely all parts are; −inf where a fit cannot follow, or that is not known."""
        if self.likelier is None or (self.likelier == -np.inf).any():
            return -np.inf
        return float(self.likelier.sum())

    @property
    def is_better(self) -> bool:
        """Whether the fits predict far better than the nominal model: by half of the misfit; or, as noise of the
        torques moves any twin away, by the likelihood of all parts.
        """
        return self.misfit <= BETTER * self.nominal or self.ratio > SURE


@dataclass(frozen=True)
class Approximation:
    """What speaks for and against an estimate that does not explain what was seen to the noise.

    Attributes:
        held_out: what pushes that were left out say.
        widening: by how much what is not explained makes deviations larger than if all were.
        residuals: of each trial (npush x njoint), scaled by the noise; NaN where a push was not seen.
        joints: their names (njoint).
        own: standard deviation of each unknown (nunknown), as if the model explained all.
        shift: by how much a force that the model has not, or another explanation, would change each (nunknown).
        coarsest: what a standard deviation of each (nunknown) is at most where it is determined.
        torques: of an arm, by the fits to the parts (npart x nstate x njoint), in N m; None of a chain.
        is_possible: whether a plant can have what was found.
    """

    held_out: HeldOutPushes
    widening: float
    residuals: Sequence[Array]
    joints: Sequence[str]
    own: Array
    shift: Array
    coarsest: Array
    torques: Array | None
    is_possible: bool

    @cached_property
    def deviations(self) -> Array:
        """Standard deviation of each unknown (nunknown), so that DEVIATIONS of it reach as far as 95 % intervals.

        Eq. 39.
        """
        repeated = self._reach * jackknife(self.held_out.unknowns)[: len(self.own)]
        return np.asarray(np.sqrt((self.widening * self.own) ** 2 + repeated**2 + self.shift**2))

    @property
    def _reach(self) -> float:
        """Of how many times a deviation by repetition DEVIATIONS reach as far as 95 % intervals."""
        from scipy.special import stdtrit  # which a command that only reads a DB mostly does without

        return float(stdtrit(len(self.held_out.unknowns) - 1, PROBABILITY)) / DEVIATIONS  # Student's

    @cached_property
    def agreed(self) -> tuple[int, int, str]:
        """On how many numbers the parts agree to a tenth, of how many, and what these are: of an arm joint torques, for
        many base parameters move next to nothing.
        """
        if self.torques is None:
            return int((self.deviations <= self.coarsest).sum()), len(self.own), "numbers"
        needed, unsure = ((each**2).mean(axis=0) for each in (self.torques.mean(axis=0), jackknife(self.torques)))
        known = self._reach * np.sqrt(unsure) <= COARSEST * np.sqrt(needed)
        return int(known.sum()), len(known), "joint torques"

    @property
    def holds(self) -> bool:
        """Whether the estimate is approximate."""
        return not self.why_not

    @cached_property
    def why_not(self) -> str:
        """Why it is not, in a sentence; empty where it is."""
        held = self.held_out
        if not self.is_possible:
            return "no plant has the model that fits best: its mass matrix is not positive definite, or no bodies are"
        if not held.is_better:
            return f"{self.predicted}: it is not approximate, which takes half of that"
        agreed, all_of_them, what = self.agreed
        if not agreed >= MOST * all_of_them:
            return f"{self.predicted}, but parts of the pushes agree to a tenth on {agreed} of {all_of_them} {what}"
        return ""

    @property
    def predicted(self) -> str:
        """How well pushes that were left out are predicted, in a sentence."""
        held, nominal = self.held_out.misfit, self.held_out.nominal
        by_nominal = f"{nominal:.4g} by the nominal model" if np.isfinite(nominal) else "the nominal model follows none"
        left = f"pushes that were left out have a misfit of {held:.4g} by fits to the others, {by_nominal}"
        if (ratio := self.held_out.ratio) == -np.inf:
            return left
        by = f"exp({ratio:.3g}) times" if ratio < np.inf else "infinitely many times"
        return f"{left}; with noise of the torques they are {by} as likely by those fits"

    @property
    def by_joint(self) -> dict[str, float]:
        """The misfit of each joint, by its name."""
        left = np.sqrt(np.nanmean(np.concatenate(self.residuals) ** 2, axis=0))
        return dict(zip(self.joints, left.tolist(), strict=True))

    @property
    def not_explained(self) -> str:
        """What the model leaves of what was seen, joint by joint, in a sentence."""
        each = ", ".join(f"{name} {left:.3g}" for name, left in self.by_joint.items())
        return f"residuals, scaled by the noise: {each}"

    def summary(self) -> dict[str, Any]:
        """As `study show --json` has it under `estimate`; None where the nominal model cannot follow."""
        held = self.held_out
        nominal = held.nominal if np.isfinite(held.nominal) else None
        shown = {"misfit": held.misfit, "nominal_misfit": nominal, "parts": len(held.unknowns)}
        if held.likelier is not None:
            shown["log_likelihood_ratio"] = held.ratio if np.isfinite(held.ratio) else None
        return {"held_out": shown, "misfit_by_joint": self.by_joint}
