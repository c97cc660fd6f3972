"""Torques that fall as a joint moves faster, as with no friction: what a drive logs is not all that it sends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from metaid.errors import joints_of
from metaid.models import Array
from metaid.recorded.doubts.conventions import LOST, NAMED, WRONG, Check, Fact
from metaid.recorded.doubts.scales import KNOWN
from metaid.recorded.given import Option


def falling_torques(check: Check, usual: Array) -> NDArray[np.bool_]:
    """Which joints (njoint) friction would drive once they are fast, though it holds them while they are slow, where a
    model that may have such friction explains far better than what is left of the `usual` (njoint).
    """
    equations, free = check.equations, check.free
    model, values = equations.model, equations.solution.values
    falling = equations.driven
    falling &= (usual >= WRONG) & (free < np.minimum(NAMED * usual, LOST))
    if not falling.any():
        return falling
    covariance = equations.covariance(values)
    for joint in np.flatnonzero(falling).tolist():
        slow, fast = np.zeros(len(values)), np.zeros(len(values))
        slow[model.columns["coulomb", joint]] = fast[model.columns["coulomb", joint]] = 1.0
        fast[model.columns["viscous", joint]] = equations.fastest[joint]
        holds, drives = (row @ values / np.sqrt(row @ covariance @ row) for row in (slow, -fast))
        falling[joint] = holds > KNOWN and drives > KNOWN
    return falling


def named_as_falling(check: Check, falling: NDArray[np.bool_]) -> Fact:
    """What is said of those joints, with the option that fits nothing to their torques."""
    model, values = check.equations.model, check.equations.solution.values
    names = model.named(falling)
    slopes = [f"{-values[model.columns['viscous', joint]]:.2g}" for joint in np.flatnonzero(falling).tolist()]
    unit = "N m s, of slides N s/m" if model.slides[falling].any() else "N m s"
    text = (
        f"what drives {joints_of(names)} falls with speed, by {', '.join(slopes)} {unit}, as with no friction: a drive "
        "that cancels friction may send more than it logs; "
    )
    return Fact((text, (Option("untrusted", ",".join(names)),), " fits nothing to it"))
