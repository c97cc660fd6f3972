"""By which factor the torques of each joint differ from what the nominal bodies need: units, currents, signs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.weak_form.equations import Equations
from metaid.recorded.weak_form.linear_model import LinearModel
from metaid.recorded.weak_form.windows import LogWindows

KNOWN = 4.0  # deviations from nothing: a factor that is less sure is not known
UNIT = 5.0  # a scale of a joint's torques that is farther from the others' is another unit
FAR = 2.0  # a factor of all torques that is farther from 1 is taken for another unit
CORRELATED = 6.0  # rows that say as much as one, for errors last
EXPLAINS = 0.5  # of what friction leaves of a joint's torque, squared: bodies that explain less tell no factor
ROUNDING = 1e-9  # of the largest torque of nominal bodies: what a joint needs or carries beside it is rounding
BESIDE = ("viscous", "coulomb", "offset")  # the plainest friction


@dataclass(frozen=True)
class Scales:
    """The factor of each joint, beside friction that is fitted, by all that it needs, `whole`, by what it carries,
    `by_weight`, and by what it moves, `by_motion` (njoint each); NaN where the joint does not tell. And which joints
    carry anything (njoint).
    """

    whole: Array
    by_weight: Array
    by_motion: Array
    carries: NDArray[np.bool_]

    @property
    def joined(self) -> Array:
        """Those that count (njoint). A rough model may have inertias that are farther off than any unit. Where what a
        joint carries and what it moves ask for other factors, that of what it carries counts.
        """
        agree = (self.by_motion / self.by_weight >= 1.0 / FAR) & (self.by_motion / self.by_weight <= FAR)
        return np.where(np.isfinite(self.by_weight) & ~agree, self.by_weight, self.whole)


def scales_of(equations: Equations) -> Scales:
    """Of the joints, by the nominal bodies beside friction, and beside a rotor where a joint carries nothing."""
    model, scales = equations.model, np.full((3, equations.model.njoint), np.nan)
    solution, rows = equations.solution, equations.columns
    carried = [_carried(part, model, solution.zeros[part.log]) for part in equations.parts]
    rotors = [part.averaged(part.accelerations) for part in equations.parts]
    needs = [own[..., : model.nbody] @ model.nominal for own in rows]
    nothing = ROUNDING * max(float(np.abs(each).max()) for each in needs)
    carries = np.max([np.abs(each).max(axis=(0, 1)) for each in carried], axis=0) > nothing
    for joint in np.flatnonzero(~model.untrusted).tolist():
        own = np.concatenate([each[:, :, joint].reshape(-1, each.shape[-1]) for each in rows])
        sent, needed, weight, rotor = (
            np.concatenate([each[:, :, joint].ravel() for each in parts])
            for parts in (equations.torques, needs, carried, rotors)
        )
        beside = own[:, [model.columns[term, joint] for term in BESIDE if (term, joint) in model.columns]]
        if not carries[joint]:  # its rotor may be many times the inertia that nominal bodies have
            weight, beside = np.zeros_like(weight), np.column_stack([beside, rotor])
        scales[:1, joint] = _factors(needed[:, None], beside, sent)
        scales[1:, joint] = _factors(np.column_stack([weight, needed - weight]), beside, sent)
    whole, by_weight, by_motion = scales
    return Scales(whole, by_weight, by_motion, carries)


def _carried(part: LogWindows, model: LinearModel, zeros: Array) -> Array:
    """The averaged torque that holds the nominal bodies (nwindow x ntest x njoint), in N m or N."""
    windows = part.thinned()
    still = np.zeros_like(windows.speeds)
    return windows.averaged(model.rigid(model.nominal, windows.coordinates + zeros, still, still))


def _factors(bodies: Array, beside: Array, sent: Array) -> Array:
    """By how much the torques of `bodies` (nrow x nbody) are to be multiplied, `beside` friction and a rotor (nrow x
    nterm), to make what was `sent` (nrow); NaN where that is not known, or bodies explain little.
    """
    stacked = np.column_stack([bodies, beside])
    rubbing = beside @ np.linalg.lstsq(beside, sent, rcond=1e-10)[0]
    size = np.sqrt((stacked**2).sum(axis=0))
    unit = stacked / np.where(size > 0.0, size, 1.0)
    inverse = np.linalg.pinv(unit.T @ unit, rcond=1e-10, hermitian=True)
    solved = inverse @ (unit.T @ sent)
    left, by_friction = (float(((sent - each) ** 2).sum()) for each in (unit @ solved, rubbing))
    variances = left / max(len(sent) / CORRELATED - unit.shape[1], 1.0) * np.diag(inverse)
    first = slice(bodies.shape[1])
    is_known = (np.abs(solved) > KNOWN * np.sqrt(variances))[first] & (left < (1.0 - EXPLAINS) * by_friction)
    return np.where(is_known & (size[first] > 0.0), solved[first] / np.maximum(size[first], 1e-300), np.nan)


def torque_scale(equations: Equations) -> float:
    """The factor of all torques, by joints that carry something if any of them tells; 1 where it is within FAR."""
    scales = scales_of(equations)
    known = np.abs(scales.joined)
    tells = np.isfinite(known)
    tells &= scales.carries | ~(tells & scales.carries).any()
    factor = float(np.median(known[tells])) if tells.any() else 1.0
    return factor if not 1.0 / FAR <= factor <= FAR else 1.0
