"""The motion of a trial as texts in the DB, its windows or what its sensors read: exact, compact, and read without
pickle.

Each text is JSON. Of every push the first windows or readings are there, up to a fall: the numbers of these alone, push
by push, are little-endian in base64.

Of windows it has `ends`, the steps at which they end; `seen`, how many of each push ended before a fall; `joints`,
njoint; `motion` (npush x nwindow x 4 x njoint, float64) and `half_periods` (npush x nwindow x njoint, of the unsigned
integers that `counts` names). Half periods that are all zero are left out.

Of readings it has `counts`, how many there are of each push; `most`, how many there can be; `joints`, njoint; `angles`,
where there is a speed sensor `speeds`, and where they are told `times` (float64).
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.episode import QUANTITIES, SensorReadings, Windows

FLOAT = "<f8"
UNSIGNED = ("|u1", "<u2", "<u4", "<u8")
LARGEST = 10_000_000  # numbers in the readings of a trial; a text that claims more was not written by metaid


def windows_text(windows: Windows) -> str:
    """The text of `windows`."""
    seen = _first(windows.seen, len(windows.ends))
    half_periods = windows.half_periods[seen]
    counts = np.min_scalar_type(half_periods.max(initial=0)).newbyteorder("<")
    parts = {
        "ends": windows.ends.tolist(),
        "seen": windows.seen.tolist(),
        "joints": windows.motion.shape[3],
        "motion": _packed(windows.motion[seen]),
    }
    if half_periods.any():
        parts |= {"counts": counts.str, "half_periods": _packed(half_periods, counts.str)}
    return json.dumps(parts, separators=(",", ":"))


def windows_of(text: str) -> Windows:
    """The windows that a `text` holds.  Raises ValueError, TypeError or LookupError where it holds none."""
    parts = json.loads(text)
    ends, counts = np.array(parts["ends"], dtype=np.int64), np.array(parts["seen"], dtype=np.int64)
    seen, njoint = _first(counts, len(ends)), int(parts["joints"])
    motion = _whole(parts["motion"], seen, (QUANTITIES, njoint))
    if not (np.diff(ends, prepend=0) > 0).all():
        raise ValueError("windows that do not follow one another")
    if "half_periods" not in parts:
        return Windows(ends, counts, motion, np.zeros((*seen.shape, njoint), dtype=np.int64))
    if parts["counts"] not in UNSIGNED:
        raise ValueError(f"counts are {parts['counts']}")
    half_periods = _whole(parts["half_periods"], seen, (njoint,), parts["counts"])
    return Windows(ends, counts, motion, half_periods.astype(np.int64))


def readings_text(readings: SensorReadings) -> str:
    """The text of `readings`."""
    _, most, njoint = readings.angles.shape
    seen = _first(readings.counts, most)
    parts = {
        "counts": readings.counts.tolist(),
        "most": most,
        "joints": njoint,
        "angles": _packed(readings.angles[seen]),
    }
    if readings.speeds is not None:
        parts["speeds"] = _packed(readings.speeds[seen])
    if readings.times is not None:
        parts["times"] = _packed(readings.times[seen])
    return json.dumps(parts, separators=(",", ":"))


def readings_of(text: str) -> SensorReadings:
    """The readings that a `text` holds.  Raises ValueError, TypeError or LookupError where it holds none."""
    parts = json.loads(text)
    counts, most, njoint = np.array(parts["counts"], dtype=np.int64), int(parts["most"]), int(parts["joints"])
    if not ((counts >= 0) & (counts <= most)).all() or not 0 < len(counts) * most * njoint <= LARGEST:
        raise ValueError("counts of readings that are none")
    seen = _first(counts, most)
    return SensorReadings(
        counts,
        _whole(parts["angles"], seen, (njoint,)),
        _whole(parts["speeds"], seen, (njoint,)) if "speeds" in parts else None,
        _whole(parts["times"], seen, ()) if "times" in parts else None,
    )


# By the attribute of a trial that has it, which is the field of its outcome as well: its text, and read from that.
MOTIONS: dict[str, tuple[Callable[[Any], str], Callable[[str], Any]]] = {
    "windows": (windows_text, windows_of),
    "readings": (readings_text, readings_of),
}


def _first(counts: NDArray[np.int64], most: int) -> NDArray[np.bool_]:
    """Which of `most` windows or readings of each push are kept (npush x most): the first `counts` (npush) of each."""
    return np.asarray(np.arange(most) < counts[:, None], dtype=np.bool_)


def _packed(numbers: NDArray[Any], kind: str = FLOAT) -> str:
    """The bytes of `numbers` as such of a `kind`, in base64."""
    return base64.b64encode(numbers.astype(kind).tobytes()).decode("ascii")


def _whole(text: str, seen: NDArray[np.bool_], each: tuple[int, ...], kind: str = FLOAT) -> NDArray[Any]:
    """The array (npush x most x each) whose packed numbers a `text` has; 0 where nothing was `seen` (npush x most).

    Args:
        text: of what was seen.
        seen: what was.
        each: the shape of one window or reading.
        kind: of the numbers.

    Raises:
        ValueError: there are more or fewer numbers, or one is not finite.
    """
    numbers = np.frombuffer(base64.b64decode(text, validate=True), dtype=kind)
    if not np.isfinite(numbers).all():
        raise ValueError("numbers that are none")
    packed = numbers.reshape(int(seen.sum()), *each)
    whole = np.zeros((*seen.shape, *each), dtype=numbers.dtype.newbyteorder("="))
    whole[seen] = packed
    return whole
