"""The unknowns that fit the averaged torques of many windows, and how well they are known.

Joints and their errors are weighed by the covariance of what is left, which is found in a few rounds. What is believed
of the bodies is a reading like any other. Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models import Array
from metaid.recorded.linear_model import LinearModel

ROUNDS = 4
FLAT = 100.0  # how many times its torque a joint's friction may be beforehand: no belief at all
LEAST = 1e-9  # of the largest torque, that any joint's error is at least: rounding
UNCERTAIN = 1e-6  # of a belief's deviations, that all combinations of them have at least


@dataclass(frozen=True)
class Fit:
    """What fits some windows.

    Attributes:
        values: the unknowns (nparam).
        precision: H, of the unknowns if the rows were independent (nparam x nparam).
        belief: the part of it that was believed beforehand (nparam x nparam).
        left: the torque that is not explained (nwindow x ntest x njoint), in N m or N.
        weight: the inverse of its covariance (njoint x njoint).
    """

    values: Array
    precision: Array
    belief: Array
    left: Array
    weight: Array


def grams_of(rows: Array) -> Array:
    """The Gram matrix of each pair of joints (njoint x njoint x nparam x nparam) of rows (nwindow x ntest x njoint x
    nparam). Neither torques nor weights have a part in it, so it serves for many fits.
    """
    njoint, nparam = rows.shape[-2:]
    by_joint = np.ascontiguousarray(rows.reshape(-1, njoint, nparam).transpose(1, 0, 2))
    grams = np.empty((njoint, njoint, nparam, nparam))
    for one in range(njoint):
        for other in range(one + 1):
            grams[one, other] = by_joint[one].T @ by_joint[other]
            grams[other, one] = grams[one, other].T
    return grams


def fit(rows: Array, torques: Array, believed: tuple[Array, Array], grams: Array | None = None) -> Fit:
    """The unknowns θ that fit windows.  Eq. 58.

    Args:
        rows: Φ, the averaged torque for a unit of each unknown (nwindow x ntest x njoint x nparam).
        torques: that were sent, averaged (nwindow x ntest x njoint).
        believed: the unknowns (nparam) and the precision of that belief (nparam x nparam).
        grams: those of the rows, where they are known.
    """
    nominal, belief = believed
    njoint, nparam = rows.shape[-2:]
    largest = float(np.abs(torques).max()) or 1.0
    floor = (LEAST * largest) ** 2 * np.eye(njoint)
    spread = np.diag(np.maximum((torques**2).mean(axis=(0, 1)), LEAST * largest**2))
    flat, sent = rows.reshape(-1, njoint, nparam), torques.reshape(-1, njoint)
    grams = grams_of(rows) if grams is None else grams
    moments = np.einsum("wip,wj->ijp", flat, sent, optimize=True)
    covariance = spread
    for _ in range(ROUNDS):
        weight = np.asarray(np.linalg.inv(covariance + floor), dtype=np.float64)
        precision = np.einsum("ij,ijpq->pq", weight, grams) + belief
        scale = 1.0 / np.sqrt(np.diag(precision))
        moment = np.einsum("ij,ijp->p", weight, moments) + belief @ nominal
        values = scale * np.linalg.solve(precision * np.outer(scale, scale), scale * moment)
        left = sent - flat @ values
        covariance = left.T @ left / len(left)
    return Fit(values, precision, belief, left.reshape(torques.shape), weight)


def belief_of(model: LinearModel, rows: Array, torques: Array) -> tuple[Array, Array]:
    """What is believed of the unknowns beforehand (nparam), and the precision of that (nparam x nparam): of friction
    next to nothing.
    """
    nparam = rows.shape[-1]
    nominal, precision = np.zeros(nparam), np.zeros((nparam, nparam))
    nominal[: model.nbody] = model.nominal
    deviations = np.sqrt(np.maximum(np.diag(model.covariance), 0.0))
    deviations = np.where(deviations > 0.0, deviations, UNCERTAIN * max(float(deviations.max(initial=0.0)), UNCERTAIN))
    correlation = model.covariance / np.outer(deviations, deviations) + UNCERTAIN * np.eye(model.nbody)
    precision[: model.nbody, : model.nbody] = np.linalg.inv(correlation) / np.outer(deviations, deviations)
    usual = np.sqrt((torques**2).mean())
    of_unit = np.sqrt((rows[..., model.nbody :] ** 2).mean(axis=(0, 1, 2)))
    widest = FLAT * usual / np.where(of_unit > 0.0, of_unit, 1.0)
    friction = np.arange(model.nbody, nparam)
    precision[friction, friction] = 1.0 / widest**2
    return nominal, precision


def covariance_of(found: Fit, rows: Array, lags: int) -> Array:
    """The covariance of the unknowns (nparam x nparam), whatever the errors of a window are, and though those of up to
    `lags` windows after one another belong together.  Eq. 59.

    Args:
        found: the fit.
        rows: that it is of (nwindow x ntest x njoint x nparam).
        lags: how many windows an error lasts.
    """
    scores = np.einsum("wajp,jk,wak->wp", rows, found.weight, found.left)
    together = scores.T @ scores
    for lag in range(1, min(lags, len(scores) - 1) + 1):
        pairs = scores[lag:].T @ scores[:-lag]
        together += (1.0 - lag / (lags + 1.0)) * (pairs + pairs.T)
    readings, nparam = found.left.size, len(found.values)
    together *= readings / max(readings - nparam, 1)
    scale = 1.0 / np.sqrt(np.diag(found.precision))
    inverse = np.linalg.inv(found.precision * np.outer(scale, scale)) * np.outer(scale, scale)
    return np.asarray(inverse @ (together + found.belief) @ inverse, dtype=np.float64)
