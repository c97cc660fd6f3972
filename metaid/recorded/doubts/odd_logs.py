"""Whether one of several logs contradicts the others: it was recorded otherwise, or is broken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from metaid.recorded.estimating import RecordedEstimate

PLAIN = ("viscous", "coulomb")
SPOILS = 0.5  # of the error with which the others are predicted: without the log it is less


def odd_log(found: RecordedEstimate) -> tuple[str, float, float] | None:
    """Of whole logs that were held out those without which the others predict one another far better: their names, and
    the error of the others without them and with them, as shares of their torques; None where there are none. Without
    them friction is the plainest, and encoders have no zeros: what was chosen with such a log need not suit the others.
    """
    yardstick, chosen = found.chosen.yardstick, found.equations
    if yardstick.by != "logs":
        return None
    plain = replace(chosen.with_model(chosen.model.with_friction(PLAIN)), zeros=False)
    errors = []
    for odd, fold in enumerate(yardstick.folds):
        numbers = [number for number in range(len(yardstick.folds)) if number != odd]
        others = replace(yardstick, folds=tuple(yardstick.folds[number] for number in numbers))
        without = others.judged(plain, [plain.without(number, odd) for number in numbers]).relative
        parts = [part for part in found.held_out.parts if part.fold != odd]
        beside = np.sqrt(
            sum(part.squares.sum() for part in parts) / max(sum(part.whole.sum() for part in parts), 1e-300)
        )
        errors.append((", ".join(found.names[log] for log in fold.logs), without, float(beside)))
    least = min(errors, key=lambda each: each[1])
    return least if np.isfinite(least[1]) and least[1] < SPOILS * least[2] else None
