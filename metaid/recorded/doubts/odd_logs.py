"""Whether one of several logs contradicts the others: it was recorded otherwise, or is broken; or goes beyond them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from metaid.models import Array
from metaid.recorded.doubts.conventions import Fact
from metaid.recorded.estimating import RecordedEstimate
from metaid.recorded.held_out import HeldOut
from metaid.recorded.weak_form.linear_model import BASE
from metaid.recorded.weak_form.smoothed import Smoothed

BEYOND = 1.5  # times the largest acceleration that was learned
LARGEST = 0.99  # quantile of what is judged
WORSE = 1.25  # times the error of what was left out
SPOILS = 0.5  # of the error with which the others are predicted with the log: without it they are to less


def odd_log(found: RecordedEstimate) -> Fact | None:
    """Of whole logs that were held out those without which the others predict one another far better; None where there
    are none. Friction is the plainest then, and encoders have no zeros: what was chosen with such a log need not suit
    the others. With it they are predicted so, or as the estimate does, if better.
    """
    yardstick, chosen = found.chosen.yardstick, found.equations
    if yardstick.by != "logs":
        return None
    plain = replace(chosen.with_model(chosen.model.with_friction(BASE)), zeros=False)
    errors = []
    for odd, fold in enumerate(yardstick.folds):
        numbers = [number for number in range(len(yardstick.folds)) if number != odd]
        others = replace(yardstick, folds=tuple(yardstick.folds[number] for number in numbers))
        without, beside = (
            others.judged(plain, [plain.without(number, *left_out) for number in numbers]).relative
            for left_out in ((odd,), ())
        )
        beside = min(beside, found.held_out.without(odd))
        errors.append((without, beside, ", ".join(found.records[log].name for log in fold.logs)))
    without, beside, name = min(errors, key=lambda each: each[0] / max(each[1], 1e-300))
    if not (np.isfinite(without) and without < SPOILS * beside):
        return None
    text = (
        f"{name} contradicts the other logs, which predict one another to {without:.1%} without it, to {beside:.1%} "
        "with it: leave it out, or see what is wrong"
    )
    return Fact((text,))


def beyond_learned(found: RecordedEstimate, validation: Sequence[tuple[Smoothed, HeldOut]]) -> Iterator[str]:
    """A sentence on each of the logs that nothing was fitted to that is predicted worse than what was left out, and
    accelerates a joint far more than any other did: what its torques need of inertia was not learned.
    """
    learned = np.max([_accelerated(own) for own in found.logs], axis=0)
    for own, held in validation:
        times = _accelerated(own) / np.maximum(learned, 1e-300)
        times[found.equations.held | own.held | found.model.untrusted] = 0.0
        worst = int(times.argmax())
        if times[worst] > BEYOND and held.relative > WORSE * found.held_out.relative:
            yield (
                f"{own.record.name} accelerates joint {found.model.joints[worst]} {times[worst]:.2g} times as much as "
                f"what was learned, and is predicted to {held.relative:.1%}, not {found.held_out.relative:.1%}: learn "
                "such motion, too"
            )


def _accelerated(own: Smoothed) -> Array:
    """How much each joint is accelerated (njoint), in rad/s² or m/s²; 0 in a log that is nowhere judged."""
    rows = np.abs(own.accelerations[own.judged])
    return np.quantile(rows, LARGEST, axis=0) if len(rows) else np.zeros(own.accelerations.shape[1])
