"""A motion as a file that a robot's driver reads: CSV, or a ROS 2 JointTrajectory as YAML."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from metaid.errors import PlantError, unknown
from metaid.excitation.exciting import RATE, Excitation

SUFFIXES = (".csv", ".yaml")
DIGITS = 7


def write_motion(found: Excitation, path: Path, rate: float = RATE) -> None:
    """Writes a motion with so many rows a second.  Raises PlantError where the ending is none of SUFFIXES."""
    if path.suffix not in SUFFIXES:
        raise PlantError(f"{path}: {unknown('ending', path.suffix, SUFFIXES)}")
    if path.suffix == ".csv":
        found.frame(rate).to_csv(path, index=False, float_format=f"%.{DIGITS}g")
    else:
        times = np.arange(round(found.seconds * rate) + 1) / rate
        path.write_text("\n".join(_joint_trajectory(found, times)) + "\n", encoding="utf-8")


def _joint_trajectory(found: Excitation, times: np.ndarray) -> Iterator[str]:
    """The lines of a trajectory_msgs/msg/JointTrajectory."""
    yield "header:\n  stamp: {sec: 0, nanosec: 0}\n  frame_id: ''"
    yield f"joint_names: {json.dumps(list(found.joints), ensure_ascii=False)}\npoints:"
    for time, *rows in zip(times.tolist(), *found.at(times), strict=True):
        for kind, row in zip(("positions", "velocities", "accelerations"), rows, strict=True):
            begin = "- " if kind == "positions" else "  "
            yield f"{begin}{kind}: [{', '.join(f'{value:.{DIGITS}g}' for value in row.tolist())}]"
        nanoseconds = round(1e9 * time)
        yield f"  time_from_start: {{sec: {nanoseconds // 10**9}, nanosec: {nanoseconds % 10**9}}}"
