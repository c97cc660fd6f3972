"""Gaps: a log is cut there into runs, and what is too short for one is left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from metaid.recorded.reading.plausible import LEAST_ROWS
from metaid.recorded.reading.readings import Record, counted

GAP = 0.5  # s between two rows: nobody knows what happened there
RARELY = 20.0  # periods of a log that is read so rarely
SHORT = 1.0  # s: what is shorter is no run of its own


def runs_of(readings: Record) -> list[Record]:
    """The runs between the gaps of a log, the first of which says what was repaired."""
    gap = max(GAP, RARELY * readings.period)
    late = np.flatnonzero(np.diff(readings.times) > gap)
    if not len(late):
        return [readings]
    steps = np.diff(readings.times)[late]
    parts = [readings.rows(each) for each in np.split(np.arange(len(readings)), late + 1)]
    runs = [part for part in parts if len(part) >= LEAST_ROWS and part.times[-1] - part.times[0] >= SHORT]
    if not runs:
        return [readings]
    between = f"{steps.min():.3g} s" if len(late) == 1 else f"{steps.min():.3g} to {steps.max():.3g} s"
    what = f"{counted(len(late), 'gap')} of {between}: cut there into {counted(len(runs), 'run')}"
    lost = len(readings) - sum(map(len, runs))
    if lost:
        what += f", {counted(lost, 'row')} between gaps left out"
    runs[0] = runs[0].repaired("gaps", len(late), what)
    said = (runs[0].repairs[-1],)
    return [
        replace(run, times=run.times - run.times[0], repairs=run.repairs if run is runs[0] else said) for run in runs
    ]
