"""The sensor readings of a trial as one text in the DB: exact, and read without pickle.

The text is JSON: `counts`, how many readings there are of each push; `most`, how many there can be; `joints`, njoint;
`angles`, where there is a speed sensor `speeds`, and where they are told `times` (float64), push by push, little-endian
in base64.
"""

from __future__ import annotations

import json

import numpy as np

from metaid.episode import SensorReadings
from metaid.models import Array
from metaid.store.windows import array_of, text_of

KEY = "readings"  # the trial attribute
LARGEST = 10_000_000  # numbers in a trial; a text that claims more was not written by metaid


def encoded(readings: SensorReadings) -> str:
    """The text of `readings`."""
    _, most, njoint = readings.angles.shape
    seen = np.arange(most) < readings.counts[:, None]  # npush x nreading
    parts = {
        "counts": readings.counts.tolist(),
        "most": most,
        "joints": njoint,
        "angles": text_of(readings.angles[seen].astype("<f8")),
    }
    if readings.speeds is not None:
        parts["speeds"] = text_of(readings.speeds[seen].astype("<f8"))
    if readings.times is not None:
        parts["times"] = text_of(readings.times[seen].astype("<f8"))
    return json.dumps(parts, separators=(",", ":"))


def decoded(text: str) -> SensorReadings:
    """The readings that a `text` holds.  Raises ValueError, TypeError or LookupError where it holds none."""
    parts = json.loads(text)
    counts, most, njoint = np.array(parts["counts"], dtype=np.int64), int(parts["most"]), int(parts["joints"])
    if not ((counts >= 0) & (counts <= most)).all() or not 0 < len(counts) * most * njoint <= LARGEST:
        raise ValueError("counts of readings that are none")

    def whole(key: str, each: int = njoint) -> Array:
        values = np.zeros((len(counts), most, each))
        read = array_of(parts[key], "<f8")
        if not np.isfinite(read).all():
            raise ValueError(f"{key} that are no numbers")
        values[np.arange(most) < counts[:, None]] = read.reshape(int(counts.sum()), each)
        return values

    speeds = whole("speeds") if "speeds" in parts else None
    times = whole("times", 1)[..., 0] if "times" in parts else None
    return SensorReadings(counts, whole("angles"), speeds, times)
