"""How well fits to some pushes predict the others: what an estimate is worth that does not explain all to the noise.

The pushes of all trials are parted. Each part is left out once, and predicted by the unknowns of a fit to the others.
Only what concerns a push alone, its start speeds, is fitted to it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.approximation import HeldOutPushes, Prediction
from metaid.estimation.descent import place_at
from metaid.estimation.estimate import Found
from metaid.estimation.fit import fit, settled
from metaid.estimation.noisy.innovations import Innovations, compared_at
from metaid.estimation.noisy.polynomials import explained_by_noise
from metaid.estimation.noisy.readings import Readings
from metaid.estimation.noisy.torque_noise import PUSHES, likeliest_noise
from metaid.models import Array

PARTS = 3  # of the pushes, each of which is left out once
LINEARISED = 1.1  # of what noise explains: so much a filter may leave, whose covariances are linearised
ROUNDS = 4  # Gauss-Newton steps of what concerns a push alone

Compared = TypeVar("Compared", bound=Readings)


def hold_out(readings: Readings, estimate: Found) -> HeldOutPushes | None:
    """What pushes that are left out say of an `estimate` of the `readings`; None where there are too few, or no fit to
    the others. Where noise of the torques stands for what the model has not, they are predicted by a twin without; and
    where it explains what the estimate leaves, likelihoods judge, too.
    """
    compared, noise = compared_at(readings, estimate), None
    if compared is None:
        return None
    judged = compared if estimate.led_misfit is None else readings
    if estimate.led_misfit is not None and estimate.led_misfit < LINEARISED * estimate.explained_below:
        noise = estimate.torque_noise
    pushes, count = max(len(trial.steps) for trial in compared.trials), len(compared.spreads)
    parts = min(PARTS, pushes)
    if parts < 2:
        return None
    fits, squares, likelier = [], np.zeros((3, parts)), np.zeros(parts)
    for part in range(parts):
        is_out = np.arange(pushes) % parts == part
        try:
            kept, left = only_pushes(compared, ~is_out), only_pushes(judged, is_out)
        except ValueError:  # every push of a part fell at once
            return None
        unknowns = settled(kept, estimate.point)
        if unknowns is None:
            return None
        fits.append(unknowns)
        squares[:2, part] = squares_of(left, unknowns)
        squares[2, part] = squares_of(left, np.zeros(count))[0]
        if noise is not None and isinstance(compared, Innovations):
            likelier[part] = _likelier(only_pushes(compared, is_out), unknowns, noise)
    own, seen, nominal = squares.sum(axis=1)
    misfits = float(np.sqrt(own / seen)), float(np.sqrt(nominal / seen))
    return HeldOutPushes(*misfits, np.array(fits), None if noise is None else likelier)


def _likelier(left: Innovations, unknowns: Array, noise: Array) -> float:
    """How much more likely these `unknowns` (nunknown) make the readings that are `left` than the nominal model does,
    in the logarithm, with that size of the `noise` (njoint), in N m, that suits either best.
    """
    both = []
    for each in (unknowns, np.zeros_like(unknowns)):
        point = np.append(each, np.zeros(left.extras))
        both.append(left.likelihood(point, likeliest_noise(left, point, noise, PUSHES), PUSHES))
    own, nominal = both
    if not np.isfinite(own):
        return -np.inf
    return own - nominal if np.isfinite(nominal) else np.inf


def predicted(readings: Readings, estimate: Found) -> Prediction | None:
    """How well an `estimate` that explains all pushes predicts some of them: those of the last trial, and of the others
    every third, which begins in the same other pose in all. None where no push can be left out.  Eq. 45.

    The squares of all pushes less those of the others alone are the squared prediction errors of the pushes held out,
    scaled by what noise and the covariance of that fit make of them.
    """
    compared = compared_at(readings, estimate)
    if compared is None:
        return None
    try:
        kept = only_pushes(compared, ~_other(compared))
    except ValueError:
        return None
    whole = place_at(compared, estimate.point, compared.stages)
    found = fit(kept, estimate.start, -1)
    part = None if found is None else kept.residuals(found.point, kept.stages)
    if whole is None or part is None:
        return Prediction(np.inf, explained_by_noise(0))
    count = max(whole.residuals.count - part.count, 1)
    return Prediction(float(np.sqrt(max(2.0 * (whole.cost - found.cost), 0.0) / count)), explained_by_noise(count))


def _other(readings: Readings) -> NDArray[np.bool_]:
    """The pushes with another law, those of the last of several trials that show anything, and in other poses (ntrial x
    npush).
    """
    pushes = np.arange(max(len(trial.steps) for trial in readings.trials))
    out = np.tile(pushes % PARTS == 1, (len(readings.trials), 1))
    shown = [number for number, trial in enumerate(readings.trials) if trial.steps.any()]
    if len(shown) > 1:
        out[shown[-1]] = True
    return out


def only_pushes(compared: Compared, pushes: NDArray[np.bool_]) -> Compared:
    """The same of these `pushes` (npush, or ntrial x npush) alone.  Raises ValueError where none shows anything."""
    each = np.broadcast_to(pushes, (len(compared.trials), pushes.shape[-1]))
    trials = [
        replace(trial, steps=np.where(kept[: len(trial.steps)], trial.steps, 0))
        for trial, kept in zip(compared.trials, each, strict=True)
    ]
    return replace(compared, trials=trials)


def not_led(compared: Readings, found: Found, point: Array) -> Found:
    """What was `found` by a twin that is led, at a `point` of all unknowns, with the misfit of the one that is not."""
    squares, seen = squares_of(compared, point[: len(compared.spreads)])
    return replace(
        found,
        led_misfit=found.misfit,
        misfit=float(np.sqrt(squares / seen)),
        explained_below=compared.explained_below,
        residuals=compared.by_joint(point),
    )


def squares_of(compared: Readings, unknowns: Array) -> tuple[float, int]:
    """The least sum of squares of the residuals at these `unknowns` (nunknown), what concerns a push alone being where
    it serves best, and how many residuals there are; inf where the twin cannot follow.
    """
    point, least, seen = np.append(unknowns, np.zeros(compared.extras)), np.inf, 1
    for _ in range(ROUNDS if compared.extras else 1):
        residuals = compared.residuals_alone(point)
        if residuals is None:
            break
        least, seen = min(least, 2.0 * residuals.cost), residuals.count
        point[len(unknowns) :] += residuals.following[:, 0]
    return least, seen
