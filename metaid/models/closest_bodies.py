"""Bodies that can be, closest to nominal ones: what is free of their parameters is chosen so that matrices stay
positive, which are linear in them.

A body of mass m, first moment s and second moments Σ is possible where its pseudo-inertia [[Σ, s], [sᵀ, m]] is
positive definite. How far it is from the nominal one is the divergence of Eq. 77, which depends neither on units nor on
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
    """Symmetric matrices (count x size x size) that are to be positive definite, linear in parameters x (nparam).

    Attributes:
        slope: by each of x (count x size x size x nparam).
        nominal: what they are to be close to (count x size x size), positive definite.
    """

    slope: Array
    nominal: Array

    @cached_property
    def scaled(self) -> Array:
        """The slope, scaled by the nominal ones, (nparam x count x size x size)."""
        return _between(np.linalg.inv(np.linalg.cholesky(self.nominal)), np.moveaxis(self.slope, -1, 0))

    def at(self, x: Array) -> Array:
        """The scaled matrices (count x size x size)."""
        return np.asarray((x @ self.scaled.reshape(len(x), -1)).reshape(self.nominal.shape), dtype=np.float64)

    def divergence(self, x: Array) -> float:
        """From the nominal ones, but for a constant; inf where one is not positive definite.  Eq. 77."""
        matrices = self.at(x)
        try:
            diagonal = np.diagonal(np.linalg.cholesky(matrices), axis1=-2, axis2=-1)
        except np.linalg.LinAlgError:
            return float("inf")
        return float(np.trace(matrices, axis1=-2, axis2=-1).sum() - 2.0 * np.log(diagonal).sum())

    def inverse_roots(self, x: Array, share: float = 0.0) -> Array:
        """The inverses of the lower triangular roots (count x size x size) of what the scaled matrices have at x beyond
        a `share` of the nominal ones.
        """
        return np.linalg.inv(np.linalg.cholesky(self.at(x) - share * np.eye(self.nominal.shape[-1])))

    def reach(self, lower: Array, step: Array) -> float:
        """The share of a `step` (nparam), from where these are the inverse roots, at which one is no longer positive
        definite; inf where all stay so.
        """
        least = float(np.linalg.eigvalsh(_between(lower, self.at(step))).min(initial=0.0))
        return -1.0 / least if least < 0.0 else float("inf")

    def slopes(self, lower: Array, directions: Array | None = None, share: float = 0.0) -> tuple[Array, Array]:
        """Gradient (nfree) and curvature (nfree x nfree) of the divergence along `directions` (nparam x nfree), by
        default along each of x, where these are the inverse roots beyond a `share` of the nominal ones.
        """
        along = self.scaled if directions is None else np.tensordot(directions.T, self.scaled, axes=1)
        inside = _between(lower, along)
        traces = np.trace(along, axis1=-2, axis2=-1) / (1.0 - share) - np.trace(inside, axis1=-2, axis2=-1)
        rows = inside.reshape(len(inside), -1)
        return traces.sum(axis=-1), rows @ rows.T


def closest(groups: Sequence[Matrices], start: Array, directions: Array) -> Array | None:
    """The parameters x (nparam) at which all matrices are positive definite and closest to the nominal ones.  Eqs. 76
    and 77.

    Where they can have no share of LEAST_SHARE of the nominal ones, it is raised as far as it goes. None where this is
    not above 0: there is no such body, or none that is not many times as large as the nominal one.

    Args:
        groups: the matrices, those of one size in a group.
        start: any x (nparam) that is allowed.
        directions: in which x may be another (nparam x nfree).
    """
    x, least = start, _least(groups, start)
    share = min(LEAST_SHARE, least - 1.0)
    for _ in range(MOST_RAISES):
        x = _centre(groups, x, directions, share)
        least = _least(groups, x)
        raised = min(LEAST_SHARE, share + 0.9 * (least - share))
        if raised - share <= STALLED:
            break
        share = raised
    return x if least > 0.0 else None


def _between(lower: Array, matrices: Array) -> Array:
    between: Array = lower @ matrices @ lower.swapaxes(-1, -2)
    return between


def _least(groups: Sequence[Matrices], x: Array) -> float:
    """The least eigenvalue of all scaled matrices."""
    return min(float(np.linalg.eigvalsh(group.at(x)).min()) for group in groups if len(group.nominal))


def _centre(groups: Sequence[Matrices], x: Array, directions: Array, share: float) -> Array:
    """The x of the least divergence, of those at which all matrices have more than a `share` of the nominal ones.

    The divergence is self-concordant, so damped steps of Newton's stay among these and arrive.
    """
    for _ in range(MOST_STEPS if directions.size else 0):
        slopes, bends = zip(
            *(group.slopes(group.inverse_roots(x, share), directions, share) for group in groups), strict=True
        )
        gradient, curvature = sum(slopes), sum(bends)
        scale = 1.0 / np.sqrt(np.diag(curvature))
        step = -scale * np.linalg.lstsq(curvature * np.outer(scale, scale), scale * gradient, rcond=None)[0]
        decrement = float(np.sqrt(max(-float(gradient @ step), 0.0)))
        x = x + directions @ step / (1.0 + decrement if decrement > 0.25 else 1.0)
        if decrement <= CENTRED:
            break
    return x
