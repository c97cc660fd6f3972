"""Bodies that can be, closest to nominal ones: what is free of their parameters is chosen so that matrices stay
positive.

A body of mass m, first moment s and second moments Σ is possible where its pseudo-inertia [[Σ, s], [sᵀ, m]] is
positive definite. How far it is from the nominal one is the divergence of Eq. 54, which depends neither on units nor on
the frame. Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from metaid.models.lumps import Array

LEAST_SHARE = 0.05  # of a nominal matrix: the body keeps so much of it, if it can
STALLED = 1e-6  # a share that grows by less has reached its end
MOST_RAISES = 40  # of the share; where there are bodies of about the nominal size, two or three lead to them
MOST_STEPS = 200  # of Newton's, for one share
CENTRED = 1e-10  # Newton's decrement, of a point that is at its centre


@dataclass(frozen=True)
class Matrices:
    """Symmetric matrices (count x size x size) that are to be positive definite: `offset` + `slope` x for the free x
    (nfree).

    Attributes:
        offset: at x = 0 (count x size x size).
        slope: by each of x (count x size x size x nfree).
        nominal: what they are to be close to (count x size x size), positive definite.
    """

    offset: Array
    slope: Array
    nominal: Array

    @cached_property
    def scaled(self) -> tuple[Array, Array]:
        """In units of the nominal ones: offset (count x size x size), slope (nfree x count x size x size)."""
        lower = np.linalg.inv(np.linalg.cholesky(self.nominal))
        return _between(lower, self.offset), _between(lower, np.moveaxis(self.slope, -1, 0))

    def at(self, x: Array) -> Array:
        """The scaled matrices (count x size x size)."""
        offset, slope = self.scaled
        return np.asarray(offset + np.tensordot(x, slope, axes=1), dtype=np.float64)

    def divergence(self, x: Array) -> float:
        """From the nominal ones, but for a constant; inf where one is not positive definite.  Eq. 54."""
        matrices = self.at(x)
        try:
            diagonal = np.diagonal(np.linalg.cholesky(matrices), axis1=-2, axis2=-1)
        except np.linalg.LinAlgError:
            return float("inf")
        return float(np.trace(matrices, axis1=-2, axis2=-1).sum() - 2.0 * np.log(diagonal).sum())

    def slopes(self, x: Array, share: float = 0.0) -> tuple[Array, Array]:
        """Gradient (nfree) and curvature (nfree x nfree) of the divergence, of what the matrices have beyond a `share`
        of the nominal ones.
        """
        _, slope = self.scaled
        inside = _between(np.linalg.inv(np.linalg.cholesky(self.at(x) - share * np.eye(self.nominal.shape[-1]))), slope)
        traces = np.trace(slope, axis1=-2, axis2=-1) / (1.0 - share) - np.trace(inside, axis1=-2, axis2=-1)
        rows = inside.reshape(len(x), -1)
        return traces.sum(axis=-1), rows @ rows.T


@dataclass(frozen=True)
class Closest:
    """The free `x` (nfree) at which the matrices are closest to the nominal ones, and how much of the nominal every one
    of them has there: they minus `share` times the nominal are positive semidefinite.
    """

    x: Array
    share: float

    @property
    def is_possible(self) -> bool:
        """Whether all matrices are positive definite."""
        return self.share > 0.0


def closest(groups: Sequence[Matrices], start: Array) -> Closest:
    """The free parameters at which all matrices are positive definite and closest to the nominal ones.  Eqs. 53 and 54.

    Where they can have no share of LEAST_SHARE of the nominal ones, it is raised as far as it goes; where this is not
    above 0, there is no such body, or none that is not many times as large as the nominal one.

    Args:
        groups: the matrices, those of one size in a group.
        start: any x (nfree).
    """
    x, least = start, _least(groups, start)
    share = min(LEAST_SHARE, least - 1.0)
    for _ in range(MOST_RAISES):
        x = _centre(groups, x, share)
        least = _least(groups, x)
        raised = min(LEAST_SHARE, share + 0.9 * (least - share))
        if raised - share <= STALLED:
            break
        share = raised
    return Closest(x, least)


def _between(lower: Array, matrices: Array) -> Array:
    between: Array = lower @ matrices @ lower.swapaxes(-1, -2)
    return between


def _least(groups: Sequence[Matrices], x: Array) -> float:
    """The least eigenvalue of all scaled matrices."""
    return min(float(np.linalg.eigvalsh(group.at(x)).min()) for group in groups if len(group.offset))


def _centre(groups: Sequence[Matrices], x: Array, share: float) -> Array:
    """The x of the least divergence, of those at which all matrices have more than a `share` of the nominal ones.

    The divergence is self-concordant, so damped steps of Newton's stay among these and arrive.
    """
    nfree = len(x)
    for _ in range(MOST_STEPS if nfree else 0):
        gradient, curvature = np.zeros(nfree), np.zeros((nfree, nfree))
        for group in groups:
            slope, bend = group.slopes(x, share)
            gradient, curvature = gradient + slope, curvature + bend
        scale = 1.0 / np.sqrt(np.diag(curvature))
        step = -scale * np.linalg.lstsq(curvature * np.outer(scale, scale), scale * gradient, rcond=None)[0]
        decrement = float(np.sqrt(max(-float(gradient @ step), 0.0)))
        x = x + step / (1.0 + decrement if decrement > 0.25 else 1.0)
        if decrement <= CENTRED:
            break
    return x
