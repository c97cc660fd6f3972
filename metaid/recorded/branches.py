"""Of a robot with branches the joints that logs are of: those that columns name, in the series that moves most."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import takewhile
from pathlib import Path

import numpy as np
import pandas as pd

from metaid.errors import BranchesError
from metaid.recorded.reading.columns import angles_named
from metaid.recorded.reading.formats import tables_of
from metaid.recorded.weak_form.linear_model import LEAST_SLIDE, LEAST_TURN


def joints_named(robot: BranchesError, logs: Sequence[str | Path | pd.DataFrame], topic: str | None) -> tuple[str, ...]:
    """The names of the joints that move, in series and from the base on; none where logs name none, or several series
    move alike. One that stands still is among them where others follow it, but for a slide at the base: the others move
    alike wherever it stands.

    Args:
        robot: its series.
        logs: paths or frames.
        topic: of bags that have several.

    Raises:
        RecordError: a log cannot be read.
        MissingExtraError: a package for its format is not installed.
    """
    every = tuple(dict.fromkeys(name for each in robot.series for name in each))
    reach: dict[str, float] = {}
    for number, log in enumerate(logs, 1):
        for table in tables_of(log, number, topic):
            columns = angles_named(table, every)
            frame = table.load(list(columns.values())).set_axis(list(columns), axis="columns")
            angles = frame.apply(pd.to_numeric, errors="coerce").replace([np.inf, -np.inf], np.nan)
            for name, far in (angles.max() - angles.min()).fillna(0.0).items():
                reach[str(name)] = max(reach.get(str(name), 0.0), float(far))
    moved = [_moved(each, robot.slides, reach) for each in robot.series]
    most = max(count for count, _ in moved)
    best = {names for count, names in moved if count == most > 0}
    return best.pop() if len(best) == 1 else ()


def _moved(series: Sequence[str], slides: Sequence[str], reach: Mapping[str, float]) -> tuple[int, tuple[str, ...]]:
    """How many joints of a series move, by their names from the base on, and those of all of it that count; of slides
    the names, and of joints that are in logs how far they go, in rad or m.
    """
    named = [name for name in series if name in reach]
    moving = [name for name in named if reach[name] > (LEAST_SLIDE if name in slides else LEAST_TURN)]
    while named and named[-1] not in moving:
        named.pop()
    shifts = takewhile(lambda name: name in slides and name not in moving, named)
    return len(moving), tuple(named[len(list(shifts)) :])
