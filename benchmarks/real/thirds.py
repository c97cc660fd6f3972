"""One log of an arm in three thirds: each is predicted by what the other two say, each of them a run of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.real.judging import Log
from benchmarks.real.lines import Line, Table
from benchmarks.real.torques import Turn, arm_and_terms, in_turn, read_test


def by_thirds(
    name: str, log: Log, urdf: Path, place: Path, bodies: str, gravity: Sequence[float] | None = None
) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`.

    Args:
        name: of the arm.
        log: all of it.
        urdf: what metaid is given as nominal, and MuJoCo loads.
        place: a folder.
        bodies: what its bodies are called.
        gravity: in the frame of the base, in m/s²; None for the URDF's own.
    """
    plain, classic = arm_and_terms(urdf, gravity)
    edges = np.linspace(0.0, log.times[-1] + np.median(np.diff(log.times)), 4)
    thirds = [log.rows((log.times >= begin) & (log.times < end)) for begin, end in pairwise(edges.tolist())]
    turns = []
    for number, left_out in enumerate(thirds):
        learned = [third for other, third in enumerate(thirds) if other != number]
        turns.append(Turn(f"third {number + 1}", [each.frame for each in learned], learned, read_test(left_out)))
    own = in_turn(turns, urdf, place, (f"{bodies}, fitted friction", plain), classic, gravity=gravity)
    yield from own.told(name, "thirds held out")
