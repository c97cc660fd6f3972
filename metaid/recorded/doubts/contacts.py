"""Whether a joint met something for a moment, as an end stop or a hand: what is left is almost all there."""

from __future__ import annotations

import math
import shlex

import numpy as np

from metaid.recorded.doubts.conventions import Fact
from metaid.recorded.estimating import RecordedEstimate
from metaid.recorded.given import Option

MOMENT = 0.5  # s
WITHIN = 0.7  # of the squares of what is left of a joint, that are within a MOMENT
SELDOM = 1.0 / 30.0  # of the time that is judged, that a MOMENT is at most
AROUND = 0.3  # s on either side, to be left out
MISSED = 0.03  # of a joint's torque, that is left at least


def brief_contact(found: RecordedEstimate) -> Fact | None:
    """The joint of which far the most that is left is within a moment, and when; None where there is none. Gears,
    friction and noise miss a little all the time.
    """
    model, held = found.model, found.held_out
    may = ~(model.untrusted | model.passive | found.equations.held) & (held.by_joint > MISSED)
    if SELDOM * found.moved < MOMENT or not may.any():
        return None
    moments, whole = [], np.zeros(model.njoint)
    for log, own in enumerate(found.logs):
        left = own.acting(found.delay) - own.predicted(model, found.values, found.zeros[log])
        squares = np.where(own.judged[:, None], left**2, 0.0) * own.period
        reach = max(1, round(MOMENT / own.period))
        sums = np.cumsum(np.vstack([np.zeros(model.njoint), squares]), axis=0)
        within = sums[reach:] - sums[:-reach] if len(squares) > reach else sums[-1:]
        begins = within.argmax(axis=0)
        whole += sums[-1]
        for joint in np.flatnonzero(may).tolist():
            begin = int(begins[joint])
            at = begin + int(squares[begin : begin + reach, joint].argmax())
            moments.append((joint, float(within[begin, joint]), float(own.times[at]), own.record.name))
    share, joint, time, name = max((most / max(whole[joint], 1e-300), joint, *at) for joint, most, *at in moments)
    if share < WITHIN:
        return None
    begin, end = math.floor(10.0 * max(time - AROUND, 0.0)) / 10.0, math.ceil(10.0 * (time + AROUND)) / 10.0
    option = Option("leave-out", shlex.quote(f"{name}={begin:.6g},{end:.6g}"))
    text = (
        f"{share:.0%} of what is left of joint {model.joints[joint]} is about {time:.4g} s after {name} begins, "
        f"as of an end stop, a blow or a contact: "
    )
    return Fact((text, (option,)))
