"""Whether one of several logs contradicts the others: it was recorded otherwise, or is broken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from metaid.recorded.doubts.conventions import Fact
from metaid.recorded.estimating import RecordedEstimate
from metaid.recorded.weak_form.linear_model import BASE

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
