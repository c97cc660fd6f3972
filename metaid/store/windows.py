"""The windows of a trial as one text in the DB: exact, compact, and read without pickle.

The text is JSON: `ends`, the steps at which windows end; `seen`, how many windows of each push ended before a fall;
`joints`, njoint; `motion` (npush x nwindow x 4 x njoint, float64) and `half_periods` (npush x nwindow x njoint, of the
unsigned integers that `counts` names), of the windows that were seen, push by push, little-endian in base64. Half
periods that are all zero are left out.
"""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.episode import QUANTITIES, Windows

KEY = "windows"  # the trial attribute
UNSIGNED = ("|u1", "<u2", "<u4", "<u8")


def encoded(windows: Windows) -> str:
    """The text of `windows`."""
    seen = np.arange(len(windows.ends)) < windows.seen[:, None]  # npush x nwindow
    half_periods = windows.half_periods[seen]
    counts = np.min_scalar_type(half_periods.max(initial=0)).newbyteorder("<")
    parts = {
        "ends": windows.ends.tolist(),
        "seen": windows.seen.tolist(),
        "joints": windows.motion.shape[3],
        "motion": text_of(windows.motion[seen].astype("<f8")),
    }
    if half_periods.any():
        parts |= {"counts": counts.str, "half_periods": text_of(half_periods.astype(counts))}
    return json.dumps(parts, separators=(",", ":"))


def decoded(text: str) -> Windows:
    """The windows that a `text` holds.  Raises ValueError, TypeError or LookupError where it holds none."""
    parts = json.loads(text)
    ends, counts = np.array(parts["ends"], dtype=np.int64), np.array(parts["seen"], dtype=np.int64)
    seen = np.arange(len(ends)) < counts[:, None]
    total, njoint = int(seen.sum()), int(parts["joints"])
    motion = array_of(parts["motion"], "<f8").reshape(total, QUANTITIES, njoint)
    if not np.isfinite(motion).all() or not (np.diff(ends, prepend=0) > 0).all():
        raise ValueError("windows of a motion that is none")
    whole = np.zeros((*seen.shape, *motion.shape[1:]))
    whole[seen] = motion
    counted = np.zeros((*seen.shape, njoint), dtype=np.int64)
    if "half_periods" in parts:
        counted[seen] = array_of(parts["half_periods"], _checked_kind(parts["counts"])).reshape(total, njoint)
    return Windows(ends, counts, whole, counted)


def _checked_kind(kind: str) -> str:
    if kind not in UNSIGNED:
        raise ValueError(f"counts are {kind}")
    return kind


def text_of(array: NDArray[Any]) -> str:
    """The bytes of an `array` in base64."""
    return base64.b64encode(array.tobytes()).decode("ascii")


def array_of(text: str, kind: str) -> NDArray[Any]:
    """The array of numbers of a `kind` (n) whose bytes a `text` is in base64.  Raises ValueError."""
    return np.frombuffer(base64.b64decode(text, validate=True), dtype=kind)
