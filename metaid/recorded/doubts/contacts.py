"""Whether a joint met something for moments, as an end stop or a hand: what is left is almost all there.

A fit that is robust against them finds the moments: least absolute errors of windows, by weights that follow what is
left of each window (iteratively reweighted least squares).
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.doubts.conventions import LOST, Fact
from metaid.recorded.estimating import RecordedEstimate
from metaid.recorded.given import Option
from metaid.recorded.weak_form.equations import Equations

ROUNDS = 30
RIDGE = 1e-4  # of what a column is: what no window tells stays small
FAINT = 0.02  # of a joint's torque: windows that leave less count alike
FAR = 5.0  # times what the middle window leaves, from which on one is in a moment
REST = 0.3  # of the squares of what is left of a joint, that other windows leave at most
SELDOM, OFTEN = 0.05, 0.2  # of the time that is judged, moments last at most: where the model is good, and for nothing
AROUND = 0.3  # s on either side, to be left out
MISSED = 0.03  # of a joint's torque, that is left at least


def contacts(found: RecordedEstimate, equations: Equations) -> Fact | None:
    """The joint of which far the most that is left is within moments, and when, by `equations` with plain friction;
    None where there is none. Gears, friction and noise miss a little all the time.
    """
    held, driven = found.held_out, found.equations.driven
    may = held.by_joint[driven] > MISSED
    if not may.any():
        return None
    left = _left(replace(equations, delay=found.delay), driven)
    far = left > FAR * np.maximum(np.median(left, axis=0), FAINT)
    rest = (np.where(far, 0.0, left) ** 2).sum(axis=0) / np.maximum((left**2).sum(axis=0), 1e-300)
    joint = int(np.where(may, rest, np.inf).argmin())
    moments = list(_moments(equations, far[:, joint]))
    lasting = sum(end - begin for _, begin, end in moments)
    most = SELDOM if held.relative <= LOST else OFTEN
    if not rest[joint] < REST or lasting > most * found.moved:
        return None
    names = [record.name for record in found.records]
    log, begin, end = moments[0]
    when = (
        f"about {0.5 * (begin + end):.4g} s after {names[log]} begins, as of an end stop, a blow or a contact"
        if len(moments) == 1
        else f"within {len(moments)} moments, as of a hand, an end stop or a contact"
    )
    text = f"{1.0 - rest[joint]:.0%} of what is left of joint {found.model.named(driven)[joint]} is {when}: "
    return Fact((text, tuple(_left_out(names[log], begin, end) for log, begin, end in moments)))


def _left(equations: Equations, driven: NDArray[np.bool_]) -> Array:
    """What least absolute errors leave of the torque of each joint that is `driven` (njoint) in each window, as a share
    of what is usual (nwindow x ndriven).
    """
    torques = np.concatenate(equations.torques)[..., driven]
    usual = np.sqrt((torques**2).mean(axis=(0, 1)))
    sent, rows = torques / usual, np.concatenate(equations.columns)[:, :, driven] / usual[:, None]
    rows = rows / np.maximum(np.sqrt((rows**2).sum(axis=(0, 1, 2))), 1e-300)
    left = np.ones((len(sent), len(usual)))
    for _ in range(ROUNDS):
        weighted = rows / np.maximum(left, FAINT)[:, None, :, None]
        gram = np.einsum("wtjp,wtjq->pq", weighted, rows, optimize=True)
        gram += RIDGE**2 * np.trace(gram) / len(gram) * np.eye(len(gram))
        values = np.linalg.solve(gram, np.einsum("wtjp,wtj->p", weighted, sent, optimize=True))
        left = np.sqrt(((sent - rows @ values) ** 2).mean(axis=1))
    return np.asarray(left)


def _moments(equations: Equations, is_far: NDArray[np.bool_]) -> Iterator[tuple[int, float, float]]:
    """The log, begin and end, in s, of each stretch of windows that are far (nwindow)."""
    first, half = 0, 0.5 * equations.span
    for log, middles in enumerate(equations.middles):
        at = middles[is_far[first : first + len(middles)]]
        first += len(middles)
        for each in np.split(at, np.flatnonzero(np.diff(at) > 2.0 * (AROUND + half)) + 1):
            if len(each):
                yield log, float(each[0]) - half, float(each[-1]) + half


def _left_out(name: str, begin: float, end: float) -> Option:
    """What leaves a moment out of a log of that name, and a little on either side."""
    begin, end = math.floor(10.0 * max(begin - AROUND, 0.0)) / 10.0, math.ceil(10.0 * (end + AROUND)) / 10.0
    return Option("leave-out", shlex.quote(f"{name}={begin:.6g},{end:.6g}"))
