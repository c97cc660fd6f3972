"""The unit that a column's name says, as `q1 [deg]`, `speed_rpm_1` or `tau1 (mNm)`, or the user."""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import groupby

import numpy as np

from metaid.recorded.reading.readings import Repair

OURS = {"angle": "rad", "speed": "rad/s", "torque": "Nm", "current": "A"}
SIZES = {
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180.0, "turn": 2.0 * np.pi, "m": 1.0, "mm": 1e-3},
    "speed": {
        **{"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": np.pi / 180.0, "rpm": np.pi / 30.0, "turn/s": 2.0 * np.pi},
        **{"m/s": 1.0, "mm/s": 1e-3},
    },
    "torque": {"Nm": 1.0, "mNm": 1e-3, "Ncm": 1e-2, "Nmm": 1e-3, "kNm": 1e3, "N": 1.0},
    "current": {"A": 1.0, "mA": 1e-3},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
}
_ANGLES = {
    **{"mrad": r"m(?:illi)?rad(?:ians?)?", "deg": r"deg(?:ree)?s?|°|dps", "turn": r"turns?|rev(?:olution)?s?"},
    "mm": "mm",
}
SPELLED = {
    "angle": _ANGLES,
    # `rev/min` has a `rev`, too: what is looked for first is taken.
    "speed": {"rpm": "rpm|rev/min|r/min"} | {f"{unit}/s": text for unit, text in _ANGLES.items()},
    "torque": {"mNm": "m ?n ?m", "Ncm": "n ?cm", "Nmm": "n ?mm", "kNm": "k ?n ?m"},
    "current": {"mA": "m ?a|milliamp(?:ere)?s?"},
}
TOKENS = {
    *("rad", "mrad", "deg", "degs", "degree", "degrees", "dps", "rpm", "turn", "turns", "rev", "revs"),
    *("s", "min", "per", "m", "mm", "n", "nm", "ncm", "nmm", "k", "a", "ma", "amp", "amps"),
}  # what a name may have that says a unit
KIND_OF: dict[tuple[str, ...], str] = {
    **dict.fromkeys((("rad",), ("mrad",), ("deg",), ("degree",), ("degrees",)), "angle"),
    **dict.fromkeys((("rad", "s"), ("deg", "s"), ("dps",), ("rpm",), ("rad", "sec"), ("deg", "sec")), "speed"),
    **dict.fromkeys((("nm",), ("n", "m"), ("mnm",)), "torque"),
}  # units, as the words of a name, that say alone what a column is


def spaced(name: str) -> str:
    """A name in small letters, with a blank before each that was a capital within a word."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()


def unit_in(name: str, kind: str, joint: str) -> str:
    """The unit of readings of a `kind` that a column's name says beside that of a `joint`, which may be called `turn`;
    ours where it says none, or does not say another.
    """
    beside = re.sub(rf"(?<![A-Za-z]){re.escape(joint)}(?![A-Za-z])", " ", name) if joint else name
    plain = spaced(beside).replace("·", " ").replace("*", " ")
    for unit, text in SPELLED[kind].items():
        if re.search(rf"(?<![a-z])(?:{text})(?![a-z])", plain):
            return unit
    return OURS[kind]


def converted(units: Mapping[str, str], kind: str) -> tuple[dict[str, float], tuple[Repair, ...]]:
    """By what the readings of one `kind`, angle, speed, torque or current, are multiplied where their columns are in
    `units` of their own, and a line that says so.
    """
    factors: dict[str, float] = {}
    notes = []
    for unit, group in groupby(units, key=units.__getitem__):
        own = list(group)
        if SIZES[kind][unit] != 1.0:
            factors |= dict.fromkeys(own, SIZES[kind][unit])
            which = f"{own[0]} to {own[-1]} are" if len(own) > 1 else f"{own[0]} is"
            notes.append(Repair("units", len(own), f"{which} in {unit}: converted"))
    return factors, tuple(notes)
