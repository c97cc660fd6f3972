"""A cart with a pole: which column is of which, where neither has a joint's name or number."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from metaid.recorded.reading.units import TOKENS
from metaid.recorded.reading.words import CHANGES, KIND_OF, tokens_of

SLIDING, TURNING = ("x", "position", "pos"), ("angle", "theta", "th", "phi", "alpha")
SPEEDS = ({"dx", "v", "velocity", "vel"}, {"dtheta", "dphi", "dalpha", "omega"})


def of_cart(columns: Iterable[str], slides: NDArray[np.bool_]) -> dict[str, str]:
    """What columns are called of a robot of two joints, of which one `slides` (njoint): its position and the other's
    angle, the speeds of both where each is there once, and the one torque, which moves the slide. None where a position
    or an angle is not there, or there twice.
    """
    if sorted(slides.tolist()) != [False, True]:
        return {}
    joints = int(slides.argmax()) + 1, int(slides.argmin()) + 1
    called: dict[str, list[str]] = {}
    for column in columns:
        for name in _names(tokens_of(column), joints):
            called.setdefault(name, []).append(column)
    if any(len(called.get(f"angle_{joint}", ())) != 1 for joint in joints):
        return {}
    once = {name: own[0] for name, own in called.items() if len(own) == 1}
    speeds = [f"speed_{joint}" for joint in joints]
    one_alone = speeds if len(once.keys() & {*speeds}) == 1 else []
    return {column: name for name, column in once.items() if name not in one_alone}


def _names(tokens: Sequence[str], joints: tuple[int, int]) -> Iterable[str]:
    """What a column of these words is called, of the numbers of the slide and the other."""
    words = [each for each in tokens if each not in TOKENS]
    changes = [each for each in words if each in CHANGES]
    rest = [each for each in words if each not in CHANGES]
    if len(rest) != 1 or len(changes) > 1:
        return
    for joint, places, speeds in zip(joints, (SLIDING, TURNING), SPEEDS, strict=True):
        if rest[0] in places:
            yield f"{'speed' if changes else 'angle'}_{joint}"
        elif rest[0] in speeds and not changes:
            yield f"speed_{joint}"
    if KIND_OF.get(rest[0]) in ("torque", "current") and not changes:
        yield f"{rest[0]}_{joints[0]}"
