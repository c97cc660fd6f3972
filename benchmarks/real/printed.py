"""The error that metaid prints for a file, beside what is measured here on the same rows.

metaid says its yardstick (docs/method.md, Eq. 73): angles through 20 Hz without phase on the log's own period, a grid
of that period or 4 ms, the torques that were sent and those that are predicted through a cut-off that it prints. Rows
count in which some joint is faster than 1 % of its fastest (of its 99 % quantile) within 0.25 s, but for 0.2 s at both
ends and around gaps. A joint that is held in a log, which turns by less than 0.02 rad or 2 % of the farthest, does not
count there (Eq. 68). Zeros and the delay are those that it prints.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from benchmarks.real.judging import ANGLES, Log, Motion, Rows, file_torques, low_pass, missed, motion_of
from benchmarks.real.lines import Line

FINEST = 0.004  # s
MOVES, AROUND, EDGE, GAP = 0.01, 0.25, 0.2, 0.05  # share of the fastest speed; s each
HELD = 0.02  # rad, and share of what the farthest turns


def judged_rows(log: Log, motion: Motion) -> Rows:
    """Which rows of a motion count (nrow)."""
    speed = np.abs(motion.speeds)
    fastest = np.quantile(speed, 0.99, axis=0)
    moves = ((speed > MOVES * fastest) & (fastest > 0.0)).any(axis=1)
    near = ndimage.binary_dilation(moves, iterations=max(1, round(AROUND / motion.period)))
    near &= (motion.times > motion.times[0] + EDGE) & (motion.times < motion.times[-1] - EDGE)
    steps = np.diff(log.times)
    for late in np.flatnonzero(steps > max(GAP, 3.0 * float(np.median(steps)))):
        near &= (motion.times < log.times[late] - EDGE) | (motion.times > log.times[late + 1] + EDGE)
    return np.asarray(near, dtype=np.bool_)


def printed_and_measured(result: Any, path: Path, logs: Sequence[Log]) -> dict[str, Any]:
    """Of a file of a RecordedResult, written at `path`, and the logs that it is of; torques that are not used apart."""
    said = result.error_of(path)
    summary = result.summary
    used = [joint["of"] > 0.0 for joint in summary["held_out"]["torque"]["joints"]]
    cutoff, delay = summary["window"]["cutoff_hz"], summary["delay"]
    pairs = []
    for log, about in zip(logs, summary["logs"], strict=True):
        motion = motion_of(log, ANGLES, cutoff, FINEST)
        predicted = low_pass(file_torques(path, motion.with_zeros(np.array(about["zeros"]))), cutoff, motion.period)
        sent = np.stack([np.interp(motion.times - delay, motion.times, each) for each in motion.torques.T], axis=1)
        reach = np.ptp(log.angles, axis=0)
        rows, counts = judged_rows(log, motion), used & (reach >= HELD * max(1.0, reach.max()))
        pairs.append((np.where(counts, predicted[rows], 0.0), np.where(counts, sent[rows], 0.0)))
    own = missed(pairs).relative
    return {"file": path.suffix, "printed": said.relative, "measured": own, "ratio": said.relative / own}


def printed_line(machine: str, rows: Sequence[dict[str, Any]]) -> Line:
    """Whether what is printed for the files of a machine is what is measured."""
    worst = max(abs(row["ratio"] - 1.0) for row in rows)
    return Line(
        f"{machine}: error that is printed for a file beside the measured one, relative difference", worst, 0.02
    )
