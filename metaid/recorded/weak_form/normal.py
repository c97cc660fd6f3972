"""Normal equations of blocks of windows: zeros of encoders eliminated log by log, the prior, and covariance.

Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.weak_form.linear_model import LinearModel

FLAT = 100.0  # how many times its torque a joint's friction may be beforehand: no prior at all
WEIGHED = 1e-5  # of what all bodies weigh together, that it is off by where that is known
UNCERTAIN = 1e-6  # of a prior's deviations, that all combinations of them have at least
ZERO = 0.05  # rad: a standard deviation of the zero of an encoder beforehand
FAR_ZERO = 4.0 * ZERO  # no zero is farther off by chance


@dataclass(frozen=True)
class Blocks:
    """Normal equations of each block of windows, where the columns of zeros stand after those of the unknowns.

    Attributes:
        grams: (nblock x nparam + njoint x nparam + njoint).
        moments: (nblock x nparam + njoint).
        logs: of which log each block is (nblock).
        shared: whether a block's windows share time with what each fold holds out (nblock x nfold).
    """

    grams: Array
    moments: Array
    logs: NDArray[np.intp]
    shared: NDArray[np.bool_]

    def without(self, *folds: int) -> Blocks:
        """Those that share no time with some folds."""
        kept = ~self.shared[:, folds].any(axis=1)
        return Blocks(self.grams[kept], self.moments[kept], self.logs[kept], self.shared[kept])


def eliminated(blocks: Blocks, nominal: Array, prior: Array, zeros: Array, are_unknown: bool) -> tuple[Array, ...]:
    """The unknowns (nparam), by how much the zeros change (nlog x njoint), and the precision of the unknowns.

    Args:
        blocks: the normal equations.
        nominal: the prior mean (nparam).
        prior: its precision (nparam x nparam).
        zeros: of the encoders at which the columns were computed (nlog x njoint), in rad.
        are_unknown: whether they are unknown.
    """
    nparam, n = len(nominal), zeros.shape[1]
    precision, moment = prior.copy(), prior @ nominal
    kept = {}
    for log in np.unique(blocks.logs):
        which = blocks.logs == log
        gram, own = blocks.grams[which].sum(axis=0), blocks.moments[which].sum(axis=0)
        precision += gram[:nparam, :nparam]
        moment = moment + own[:nparam]
        if are_unknown:
            inner = np.linalg.inv(gram[nparam:, nparam:] + np.eye(n) / ZERO**2)
            across, target = gram[:nparam, nparam:], own[nparam:] - zeros[log] / ZERO**2
            precision -= across @ inner @ across.T
            moment = moment - across @ inner @ target
            kept[int(log)] = inner, across, target
    values = solved(precision, moment)
    changes = np.zeros_like(zeros)
    for log, (inner, across, target) in kept.items():
        changes[log] = inner @ (target - across.T @ values)
    return values, changes, precision


def solved(precision: Array, moment: Array) -> Array:
    """P⁻¹ m of a precision (n x n) and a moment (n, or n x m), whatever the units of the unknowns are."""
    scale = 1.0 / np.sqrt(np.diag(precision))
    return (scale * np.linalg.solve(precision * np.outer(scale, scale), (scale * moment.T).T).T).T


def pseudo_inverse(gram: Array, least: float) -> Array:
    """P⁺ of a positive semidefinite matrix (n x n), whatever the units of the unknowns are: eigenvalues below a share
    `least` of the largest count as 0.
    """
    scales = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    both = np.outer(scales, scales)
    return np.asarray(np.linalg.pinv(gram * both, rcond=least, hermitian=True) * both, dtype=np.float64)


def eliminated_covariance(inverse: Array, scores: Sequence[Array], lags: int) -> Array:
    """H⁻¹ S H⁻¹, with S the sum of the products of the scores (nwindow x nparam) of windows of one log that are at most
    `lags` apart.  Eq. 70.
    """
    together = np.zeros_like(inverse)
    for own in scores:
        together += own.T @ own
        for lag in range(1, min(lags, len(own) - 1) + 1):
            pairs = own[lag:].T @ own[:-lag]
            together += (1.0 - lag / (lags + 1.0)) * (pairs + pairs.T)
    return np.asarray(inverse @ together @ inverse, dtype=np.float64)


def prior_of(model: LinearModel, rows: Sequence[Array], usual: float, spread: float) -> Array:
    """The precision of the unknowns beforehand (nparam x nparam): of friction next to none. What swings freely says
    nothing of how much all bodies weigh together: that is known.

    Args:
        model: what is unknown.
        rows: of each log (nwindow x ntest x njoint x nparam or more).
        usual: root mean square of what errors of torques are shares of, in N m or N.
        spread: times the deviations of the nominal bodies.
    """
    nparam, nbody = len(model.names), model.nbody
    precision = np.zeros((nparam, nparam))
    covariance = spread**2 * model.covariance
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    deviations = np.where(deviations > 0.0, deviations, UNCERTAIN * max(float(deviations.max(initial=0.0)), UNCERTAIN))
    correlation = covariance / np.outer(deviations, deviations) + UNCERTAIN * np.eye(nbody)
    precision[:nbody, :nbody] = np.linalg.inv(correlation) / np.outer(deviations, deviations)
    if model.is_free:
        precision[:nbody, :nbody] += np.outer(model.weight, model.weight) / WEIGHED**2
    squares = [(each[..., nbody:nparam] ** 2).mean(axis=(0, 1, 2)) for each in rows]
    of_unit = np.sqrt(np.mean(squares, axis=0))
    widest = FLAT * usual / np.where(of_unit > 0.0, of_unit, 1.0)
    friction = np.arange(nbody, nparam)
    precision[friction, friction] = 1.0 / widest**2
    return precision
