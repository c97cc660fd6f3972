"""One log of an arm in three thirds: each is predicted by what the other two say, each of them a run of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.real.judging import Log
from benchmarks.real.lines import Line, Table
from benchmarks.real.printed import printed_line
from benchmarks.real.torques import CLASSIC, MOST_BESIDE, STILL, YARDSTICK, Turn, in_turn, read_test, row_of
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import arm_model


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
    plain, arm = mujoco.MjModel.from_xml_path(str(urdf)), load_plant(urdf)
    assert isinstance(arm, ArmPlant)
    tree = arm.tree
    if gravity is not None:
        plain.opt.gravity[:] = gravity
        tree = replace(tree, gravity=np.array(gravity))
    classic = arm_model(tree, CLASSIC).with_still(np.full(tree.njoint, STILL))
    edges = np.linspace(0.0, log.times[-1] + np.median(np.diff(log.times)), 4)
    thirds = [log.rows((log.times >= begin) & (log.times < end)) for begin, end in pairwise(edges.tolist())]
    turns = []
    for number, left_out in enumerate(thirds):
        learned = [third for other, third in enumerate(thirds) if other != number]
        turns.append(Turn(f"third {number + 1}", [each.frame for each in learned], learned, read_test(left_out)))
    own = in_turn(turns, urdf, place, (f"{bodies}, fitted friction", plain), classic, gravity=gravity)
    title = f"{name}, torque at {YARDSTICK} Hz, thirds held out: {', '.join(own.words)}"
    yield Table(f"{title}; best {'; '.join(own.best)}", [row_of(each, found) for each, found in own.found.items()])
    short = name.split()[0]
    yield Table(f"{short}, errors that are printed", list(own.printed))
    yield printed_line(short, own.printed)
    yield Line(f"{short}: .py beside tuned least squares", own.beside, MOST_BESIDE)
