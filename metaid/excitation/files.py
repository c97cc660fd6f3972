"""A motion as a file that a robot's driver reads: CSV, or a ROS 2 JointTrajectory as YAML."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from metaid.errors import PlantError, unknown
from metaid.excitation.exciting import Excitation

SUFFIXES = (".csv", ".yaml")
RATE = 250.0  # rows a second
DIGITS = 7


def write_motion(found: Excitation, path: Path, rate: float = RATE) -> None:
    """Writes a motion with so many rows a second.  Raises PlantError where the ending is none of SUFFIXES."""
    if path.suffix not in SUFFIXES:
        raise PlantError(f"{path}: {unknown('ending', path.suffix, SUFFIXES)}")
    times = np.arange(round(found.seconds * rate) + 1) / rate
    if path.suffix == ".csv":
        motion = found.at(times)
        kinds = {
            "angle": motion.angles,
            "speed": motion.speeds,
            "acceleration": motion.accelerations,
            "nominal_torque": found.nominal_torques(times),
        }
        columns = {"time": times}
        for kind, values in kinds.items():
            columns |= {f"{kind}_{name}": each for name, each in zip(found.joints, values.T, strict=True)}
        pd.DataFrame(columns).to_csv(path, index=False, float_format=f"%.{DIGITS}g")
    else:
        path.write_text("\n".join(_joint_trajectory(found, times)) + "\n", encoding="utf-8")


def _joint_trajectory(found: Excitation, times: np.ndarray) -> Iterator[str]:
    """The lines of a trajectory_msgs/msg/JointTrajectory."""
    yield "header:\n  stamp: {sec: 0, nanosec: 0}\n  frame_id: ''"
    yield f"joint_names: {json.dumps(list(found.joints), ensure_ascii=False)}\npoints:"
    motion = found.at(times)
    for time, *rows in zip(times.tolist(), motion.angles, motion.speeds, motion.accelerations, strict=True):
        for kind, row in zip(("positions", "velocities", "accelerations"), rows, strict=True):
            begin = "- " if kind == "positions" else "  "
            yield f"{begin}{kind}: [{', '.join(f'{value:.{DIGITS}g}' for value in row.tolist())}]"
        nanoseconds = round(1e9 * time)
        yield f"  time_from_start: {{sec: {nanoseconds // 10**9}, nanosec: {nanoseconds % 10**9}}}"
