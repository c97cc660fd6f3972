"""The possible bodies whose unknowns cost least: those of a free fit, as near as bodies that can be come to them.

Matrices that are linear in the free parameters of bodies are to be positive definite. The normal equations of the free
fit say how much any other unknowns cost, so that nothing is fitted again. The log-det divergence from the nominal
bodies (Eq. 77), with a small weight, keeps what is found inside, and chooses among bodies that move alike.  Eq. 69.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from metaid.models.closest_bodies import Matrices
from metaid.models.lumps import Array

WEIGHT = 0.05  # of the divergence, beside χ² / 2
PATH = 100.0  # by which the weight falls from solution to solution
RIDGE = 1e-13  # of scaled curvatures: rounding
STEPS = 60  # of Newton's, for one weight
ROUGHLY = 0.1  # the same while the weight falls
CLOSE = 1e-6  # Newton's decrement where a point is at its centre
LONGEST = 10.0  # of the logarithm of a length in m


@dataclass(frozen=True)
class Nearest:
    """What unknowns of a free fit cost where bodies are to be possible.

    Attributes:
        cones: what is to be positive definite, by free parameters x (nfree).
        unknowns: that follow from x (nparam).
        jacobian: of these there (nparam x nfree).
        values: of the unknowns in the free fit (nparam).
        precision: of these (nparam x nparam).
        logarithms: how many of x, its last, are logarithms of lengths.
    """

    cones: Sequence[Matrices]
    unknowns: Callable[[Array], Array]
    jacobian: Callable[[Array], Array]
    values: Array
    precision: Array
    logarithms: int = 0

    def found(self, x: Array) -> Array:
        """The free parameters (nfree) that cost least, from possible ones (nfree) on."""
        weight = max(WEIGHT, self._cost(x) / max(len(x), 1))
        while True:
            x = self._centre(x, weight)
            if weight <= WEIGHT:
                return x
            weight = max(WEIGHT, weight / PATH)

    def _cost(self, x: Array) -> float:
        missed = self.unknowns(x) - self.values
        return 0.5 * float(missed @ self.precision @ missed)

    def _centre(self, x: Array, weight: float) -> Array:
        """The point of the least cost and divergence, by Newton's steps (Gauss's where lengths are unknown)."""
        present = self._total(x, weight)
        for _ in range(STEPS):
            jacobian = self.jacobian(x)
            gradient = jacobian.T @ (self.precision @ (self.unknowns(x) - self.values))
            curvature = jacobian.T @ self.precision @ jacobian
            roots = [cone.inverse_roots(x) for cone in self.cones]
            for cone, lower in zip(self.cones, roots, strict=True):
                slope, bend = cone.slopes(lower)
                gradient, curvature = gradient + weight * slope, curvature + weight * bend
            scale = 1.0 / np.sqrt(np.maximum(np.diag(curvature), 1e-300))
            scaled = curvature * np.outer(scale, scale)
            scaled[np.diag_indices_from(scaled)] += RIDGE
            step = -scale * np.linalg.solve(scaled, scale * gradient)
            decrement = -float(gradient @ step)
            if not decrement > (CLOSE if weight <= WEIGHT else ROUGHLY) * max(weight, 1e-12):
                break
            share = 0.5 ** self._halvings(x, roots, step)
            while share > 1e-10:
                tried = self._total(x + share * step, weight)
                if tried <= present - 1e-4 * share * decrement:
                    break
                share *= 0.5
            else:
                break
            x, present = x + share * step, tried
        return x

    def _halvings(self, x: Array, roots: Sequence[Array], step: Array) -> int:
        """How often a `step` from x, where cones have these inverse `roots`, is to be halved for bodies that can be and
        lengths within LONGEST.
        """
        logs, by = (each[len(x) - self.logarithms :] for each in (x, step))
        moves = by != 0.0
        lengths = (LONGEST - np.sign(by[moves]) * logs[moves]) / np.abs(by[moves])
        reach = min(
            lengths.min(initial=1.0), *(cone.reach(lower, step) for cone, lower in zip(self.cones, roots, strict=True))
        )
        return math.ceil(-math.log2(reach))

    def _total(self, x: Array, weight: float) -> float:
        divergence = sum(cone.divergence(x) for cone in self.cones)
        if not np.isfinite(divergence) or np.abs(x[len(x) - self.logarithms :]).max(initial=0.0) > LONGEST:
            return float("inf")
        return self._cost(x) + weight * divergence
