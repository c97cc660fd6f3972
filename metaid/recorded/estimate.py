"""What a log says of the plant: the unknowns, their intervals, the delay of the torques, and the held-out error."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from metaid.errors import RecordError
from metaid.models import Array
from metaid.recorded.fit import Fit
from metaid.recorded.linear_model import LinearModel
from metaid.recorded.log import Record
from metaid.recorded.suspects import SIGNIFICANT, suspects
from metaid.recorded.window_rows import WindowRows
from metaid.recorded.windows import Windows, cut_windows

SPANS = (0.06, 0.1, 0.2, 0.3, 0.5)  # s: how long windows may be, unless their user says it
FOLDS = 3
SLOW = 0.01  # of a joint's usual speed: below it dry friction is a share of its whole
LITTLE_NOISE = 1e-3  # of the variance of averaged accelerations: by so much noise makes inertias smaller


@dataclass(frozen=True)
class Choices:
    """What the user chose: `span` of the windows in s and `delay` of the torques in s; None where metaid is to."""

    span: float | None = None
    delay: float | None = None


@dataclass(frozen=True)
class RecordedEstimate:
    """What a log says.

    Attributes:
        model: what is unknown.
        values: the unknowns (nparam).
        covariance: of them (nparam x nparam), in their units.
        repeated: the unknowns without each third of the log (nfold x nparam).
        delay: by which torques act later than they are logged, in s.
        delay_deviation: its standard deviation in s; 0 where it was given.
        span: of the windows, in s.
        windows: how many there are.
        held_out: relative error of the averaged torque of each third that was predicted from the others (nfold).
        by_joint: the same of all thirds together, of each joint (njoint), as a share of its own torque.
        error: the same of all joints together.
        lacking: what the model has not, and would explain some of what is left: the intervals hold what is found with
            it, too.
        moved: how long the plant moved in the log, in s.
    """

    model: LinearModel
    values: Array
    covariance: Array
    repeated: Array
    delay: float
    delay_deviation: float
    span: float
    windows: int
    held_out: Array
    by_joint: Array
    error: float
    lacking: tuple[str, ...]
    moved: float

    @property
    def deviations(self) -> Array:
        """Standard deviations of the unknowns (nparam)."""
        return np.sqrt(np.diag(self.covariance))


def estimate_record(
    record: Record, model: LinearModel, choices: Choices | None = None, without: tuple[float, float] | None = None
) -> RecordedEstimate:
    """What a log says of a plant.

    Args:
        record: the log.
        model: what is unknown.
        choices: what the user chose.
        without: a part of the log that is not looked at, from and to in s.

    Raises:
        RecordError: the log has too little of it.
    """
    choices = choices or Choices()
    model = model.with_still(_still(record, model))
    every = {}
    for span in SPANS if choices.span is None else (choices.span,):
        windows = cut_windows(record, span)
        if windows is not None:
            if without is not None:
                windows = _chosen(windows, ~windows.overlapping(*without))
            every[span] = WindowRows(windows, record, model)
    usable = {span: each for span, each in every.items() if each.is_enough}
    if not usable:
        raise RecordError(
            f"{record.name}: too short for {len(model.names)} unknowns, or read too rarely "
            f"(allowed: more motion, or fewer terms of friction)"
        )
    span = min(usable) if len(usable) == 1 else _best_span(usable)
    return _estimate(usable, span, choices.delay)


def _estimate(usable: dict[float, WindowRows], span: float, delay: float | None) -> RecordedEstimate:
    """The estimate from windows of one length."""
    chosen = usable[span]
    windows, model, record = chosen.windows, chosen.model, chosen.record
    found, late, covariance = chosen.fitted(chosen.all, delay)
    nparam = len(model.names)
    deviation = float(np.sqrt(covariance[-1, -1])) if delay is None else 0.0
    values, covariance = found.values[:nparam], covariance[:nparam, :nparam]
    torques = windows.torques(record, late)
    repeated, misses = [], np.zeros_like(torques)
    folds = _folds(windows)
    for begin, end in folds:
        held = windows.overlapping(begin, end)
        inside = (windows.middles >= begin) & (windows.middles < end)
        part = chosen.fitted(~held, late)[0].values[:nparam]
        repeated.append(part)
        misses[inside] = torques[inside] - chosen.rows[inside] @ part
    thirds = [(windows.middles >= begin) & (windows.middles < end) for begin, end in folds]
    longer = _longer(usable, span)
    changes = [other.fitted(other.all, late)[0].values[:nparam] - values for other in longer]
    change, lacking = _of_delay(chosen, found, late, delay)
    changes.append(change)
    beside = [np.sqrt(np.diag(covariance))]
    for suspect in suspects(windows, chosen.rows, model, values):
        change, deviations, joints = chosen.changed(suspect, torques, values)
        changes.append(change)
        beside.append(deviations)
        lacking += [f"{suspect.what} of joint {model.joints[joint]}" for joint in joints]
    covariance = _widened(covariance, np.max(beside, axis=0), np.array(repeated), changes)
    return RecordedEstimate(
        model=model,
        values=values,
        covariance=covariance,
        repeated=np.array(repeated),
        delay=late,
        delay_deviation=deviation,
        span=span,
        windows=len(windows),
        held_out=np.array([_share(misses[third], torques[third]) for third in thirds]),
        by_joint=np.array([_share(misses[..., j], torques[..., j]) for j in range(model.njoint)]),
        error=_share(misses, torques),
        lacking=tuple(lacking),
        moved=float(np.diff(np.unique(np.concatenate([windows.middles - span / 2, windows.middles + span / 2]))).sum()),
    )


def _of_delay(chosen: WindowRows, found: Fit, late: float, delay: float | None) -> tuple[Array, list[str]]:
    """By which the unknowns (nparam) hang on the delay, and what to say of it.

    Of a delay that was found: how much they would change without it. The more it explains, the less that counts. Of one
    that was given: how much they change with that which the log says, so with what is not known of the time between a
    reading and a torque.
    """
    nparam = len(chosen.model.names)
    values = found.values[:nparam]
    if delay is None:
        prompt = chosen.fitted(chosen.all, 0.0)[0]
        share = _left(found) / max(_left(prompt), 1e-300)
        return share * (prompt.values[:nparam] - values), []
    other, later, covariance = chosen.fitted(chosen.all, None)
    is_other = abs(later - late) > SIGNIFICANT * np.sqrt(covariance[-1, -1])
    return other.values[:nparam] - values, [f"a delay of {1e3 * later:.3g} ms"] if is_other else []


def _longer(usable: dict[float, WindowRows], span: float) -> list[WindowRows]:
    """The windows of the next longer length: in shorter ones noise may count."""
    spans = sorted(usable)
    at = spans.index(span)
    return [usable[other] for other in spans[at + 1 : at + 2]]


def _left(found: Fit) -> float:
    """Root mean square of the torque that a fit leaves."""
    return float(np.sqrt((found.left**2).mean()))


def _widened(covariance: Array, beside: Array, repeated: Array, changes: list[Array]) -> Array:
    """A covariance (nparam x nparam) that is at least as wide as the unknowns differ.  Eq. 60.

    Args:
        covariance: from what is left of the torques alone.
        beside: the largest of the standard deviations beside anything that the model may lack (nparam).
        repeated: the unknowns without each third of the log (nfold x nparam).
        changes: by which they differ (nparam each) with other windows, another delay, and what the model may lack.
    """
    folds = len(repeated)
    deviations = np.sqrt(np.diag(covariance))
    jackknife = (folds - 1.0) / folds * ((repeated - repeated.mean(axis=0)) ** 2).sum(axis=0)
    wider = np.sqrt(np.maximum(np.maximum(beside, deviations) ** 2, jackknife) + np.sum(np.square(changes), axis=0))
    growth = wider / np.where(deviations > 0.0, deviations, 1.0)
    return np.asarray(covariance * np.outer(growth, growth), dtype=np.float64)


def _best_span(usable: dict[float, WindowRows]) -> float:
    """The shortest windows, in s, in which the noise of the angles hardly counts; those where it counts least, if it
    counts in all.
    """
    noise = np.min([each.windows.noise for each in usable.values()], axis=0)
    shares = {span: float(each.windows.noise_share(noise).max()) for span, each in sorted(usable.items())}
    return next((span for span, share in shares.items() if share < LITTLE_NOISE), min(shares, key=shares.__getitem__))


def _folds(windows: Windows) -> list[tuple[float, float]]:
    """Parts of the log, from and to in s, in each of which the plant moves for a third of the time."""
    parts = np.array_split(windows.middles, FOLDS)
    edges = [-np.inf, *(float(part[0]) for part in parts[1:]), np.inf]
    return list(pairwise(edges))


def _still(record: Record, model: LinearModel) -> Array:
    """Below which speed of each joint (njoint) dry friction is a share of its whole, in rad/s or m/s."""
    stride = max(1, round(0.02 / record.period))
    angles, times = record.angles[::stride], record.times[::stride]
    usual = np.sqrt(((np.diff(angles, axis=0) / np.diff(times)[:, None]) ** 2).mean(axis=0))
    return np.where(usual > 0.0, SLOW * usual, 1.0)


def _chosen(windows: Windows, which: NDArray[np.bool_]) -> Windows:
    return replace(
        windows,
        middles=windows.middles[which],
        coordinates=windows.coordinates[which],
        speeds=windows.speeds[which],
        accelerations=windows.accelerations[which],
    )


def _share(missed: Array, whole: Array) -> float:
    """The error as a share of the whole, both root mean square."""
    scale = float((whole**2).sum())
    return float(np.sqrt((missed**2).sum() / scale)) if scale else 0.0
