"""What was measured and what was predicted over time, of what was left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.estimating import RecordedEstimate
from metaid.recorded.held_out import HeldOut, Yardstick


@dataclass(frozen=True)
class LeftOut:
    """One log, or a third of it, that was predicted from the others: times in s (nrow), and torques that were
    `measured` and `predicted` (nrow x njoint), in N m or N, through the filter; `judged` are the rows that count.
    """

    log: str
    times: Array
    measured: Array
    predicted: Array
    judged: NDArray[np.bool_]


def left_out(found: RecordedEstimate) -> list[LeftOut]:
    """All logs, or their thirds, each predicted by what the others say."""
    return predicted_parts(found, found.chosen.yardstick, found.held_out, found.names)


def predicted_parts(
    found: RecordedEstimate, yardstick: Yardstick, held: HeldOut, names: tuple[str, ...]
) -> list[LeftOut]:
    """The parts that were held out.

    Args:
        found: what the logs say.
        yardstick: that held them out.
        held: how well they are predicted.
        names: of the yardstick's logs.
    """
    return [
        LeftOut(
            names[part.log],
            yardstick.logs[part.log].times,
            yardstick.logs[part.log].acting(found.delay),
            yardstick.logs[part.log].predicted(found.model, part.values, part.zeros),
            part.rows,
        )
        for part in held.parts
    ]
