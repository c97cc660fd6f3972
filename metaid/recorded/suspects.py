"""What a model may lack, and how much what is found hangs on that: springs in joints, and encoders that are off.

What is left of the torques is asked whether one of them would explain some of it. Where it would, what is found is no
surer than it changes with that.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from metaid.models import Array
from metaid.recorded.linear_model import LinearModel
from metaid.recorded.windows import Windows

SIGNIFICANT = 4.0  # standard deviations from nothing
SHIFT = 1e-5  # rad or m, for the derivative by an angle


def suspects(windows: Windows, rows: Array, model: LinearModel, values: Array) -> Iterator[tuple[str, Array]]:
    """What a joint may have, in words, and the averaged torque for a unit of it in each joint (nwindow x ntest x njoint
    x njoint).

    Args:
        windows: of the log.
        rows: of them (nwindow x ntest x njoint x nparam).
        model: what is unknown.
        values: the unknowns as they were found (nparam).
    """
    joints = np.arange(model.njoint)
    springs = np.zeros((*rows.shape[:3], model.njoint))
    springs[..., joints, joints] = windows.averaged(windows.coordinates)
    yield "a spring", springs
    needed = rows @ values
    offsets = np.empty_like(springs)
    for joint in joints:
        moved = windows.coordinates + SHIFT * (joints == joint)
        offsets[..., joint] = (replace(windows, coordinates=moved).rows(model) @ values - needed) / SHIFT
    yield "an offset of the encoder", offsets
