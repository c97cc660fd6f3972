"""A rig's log: a table of times, joint angles, speeds where there are any, and torques.

A log that cannot be used is refused before anything is computed from it, in one line that says where it is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.errors import RecordError, optional_packages
from metaid.models import Array

SUFFIXES = (".csv", ".parquet")
LEAST_ROWS = 100
KINDS = {"angle": "rad", "speed": "rad/s", "torque": "N m"}
MANY_TURNS = 25.0  # rad: a hinge that is said to be farther from 0 is probably logged in degrees
CALM = 0.05  # of a joint's fastest speed: below it the ratio of two speeds says nothing
ABOVE_NOISE = 5.0  # standard deviations
FAR_FROM_ONE = 1.5  # between a speed and the change of its angle
DEGREES = 180.0 / np.pi


@dataclass(frozen=True)
class Record:
    """What a log holds.

    Attributes:
        name: of the file.
        times: when each row was read (nrow), in s.
        angles: joint coordinates (nrow x njoint), in rad, of slides in m.
        speeds: of the joints (nrow x njoint), in rad/s or m/s; None where the log has none.
        torques: of the joints (nrow x njoint), in N m or N; each holds until the next row.
    """

    name: str
    times: Array
    angles: Array
    speeds: Array | None
    torques: Array

    @property
    def njoint(self) -> int:
        return int(self.angles.shape[1])

    @property
    def period(self) -> float:
        """The usual time between two rows, in s."""
        return float(np.median(np.diff(self.times)))

    def with_torques(self, torques: Array) -> Record:
        """The same motion under these `torques` (nrow x njoint)."""
        return replace(self, torques=torques)


def read_record(
    log: str | Path | pd.DataFrame,
    joints: Sequence[str],
    slides: NDArray[np.bool_],
    needs_torques: bool = True,
    number: int = 1,
) -> Record:
    """The log in a CSV or parquet file, or in a frame.

    Its columns are `time` in s and, of every joint by its number or its name, `angle_1` in rad, `speed_1` in rad/s and
    `torque_1` in N m (of a slide in m, m/s and N). All speeds may be missing.

    Args:
        log: the path of the file, or the frame.
        joints: the names of the plant's joints, from the base on.
        slides: which of them (njoint) are slides.
        needs_torques: whether the torques must be in it; where not, and they are missing, they are 0.
        number: of the log among several, for a frame, which has no name.

    Raises:
        RecordError: it is not such a log.
        MissingExtraError: it is in parquet, and pyarrow is not installed.
    """
    path = Path(f"frame {number}") if isinstance(log, pd.DataFrame) else Path(log)
    frame = log if isinstance(log, pd.DataFrame) else _frame(path)
    columns = {kind: _columns(path, frame, kind, joints) for kind in KINDS}
    if "time" not in frame:
        raise RecordError(f"{path}: no column 'time' (allowed: time in s, and {_allowed(joints)})")
    for kind in ("angle", "torque") if needs_torques else ("angle",):
        if not columns[kind]:
            raise RecordError(f"{path}: no column '{kind}_1' (allowed: time in s, and {_allowed(joints)})")
    if len(frame) < LEAST_ROWS:
        raise RecordError(f"{path}: {len(frame)} rows (allowed: {LEAST_ROWS} or more)")
    times = _numbers(path, frame, ["time"])[:, 0]
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if late.size:
        row = int(late[0]) + 1
        raise RecordError(f"{path}: row {row + 1}: time {times[row]:g} is not after {times[row - 1]:g} s")
    angles = _numbers(path, frame, columns["angle"])
    speeds = _numbers(path, frame, columns["speed"]) if columns["speed"] else None
    torques = _numbers(path, frame, columns["torque"]) if columns["torque"] else np.zeros_like(angles)
    _refuse_degrees(path, columns["angle"], angles, slides)
    if speeds is not None:
        _refuse_other_speeds(path, columns, times, angles, speeds)
    if needs_torques and not torques.any():
        raise RecordError(f"{path}: every torque is 0, so nothing says how heavy the links are")
    if not (np.ptp(angles, axis=0) > 0.0).any():
        raise RecordError(f"{path}: no joint moves")
    return Record(path.name, times, angles, speeds, torques)


def _frame(path: Path) -> pd.DataFrame:
    """The table in a file, its cells as they are."""
    if path.suffix not in SUFFIXES:
        raise RecordError(f"{path}: the ending says the format (allowed: {', '.join(SUFFIXES)})")
    try:
        if path.suffix == ".parquet":
            with optional_packages("parquet"):
                import pyarrow  # noqa: F401, pandas reads with it
            return pd.read_parquet(path)
        return pd.read_csv(path, skipinitialspace=True, low_memory=False)
    except OSError as problem:
        why = problem.strerror or "not a file of that format"
        raise RecordError(f"{path}: {why} (allowed: the path of a log)") from None
    except (ValueError, pd.errors.ParserError) as problem:
        raise RecordError(f"{path}: not a table: {problem}") from None


def _allowed(joints: Sequence[str]) -> str:
    return f"of each of {len(joints)} joints angle_1, torque_1 and perhaps speed_1"


def _columns(path: Path, frame: pd.DataFrame, kind: str, joints: Sequence[str]) -> list[str]:
    """The columns of one `kind`, joint by joint; none where no joint has one."""
    there = [str(name) for name in frame.columns if str(name).startswith(f"{kind}_")]
    numbered = [f"{kind}_{i + 1}" for i in range(len(joints))]
    named = [f"{kind}_{name}" for name in joints]
    wanted = named if any(name in there for name in named) and not set(numbered) <= set(there) else numbered
    other = [name for name in there if name not in wanted]
    if other and there:
        raise RecordError(f"{path}: column '{other[0]}' is of no joint (allowed: {wanted[0]} to {wanted[-1]})")
    missing = [name for name in wanted if name not in there]
    if there and missing:
        raise RecordError(f"{path}: no column '{missing[0]}' (allowed: {wanted[0]} to {wanted[-1]}, all of them)")
    return there and wanted


def _numbers(path: Path, frame: pd.DataFrame, columns: list[str]) -> Array:
    """The cells of these `columns` (nrow x ncolumn), all of them finite numbers."""
    numbers: Array = frame[columns].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=np.float64)
    bad = np.argwhere(~np.isfinite(numbers))
    if bad.size:
        row, column = (int(each) for each in bad[0])
        cell = frame[columns[column]].iloc[row]
        raise RecordError(f"{path}: row {row + 1}: {columns[column]} is '{cell}' (allowed: finite numbers)")
    return numbers


def _refuse_degrees(path: Path, names: list[str], angles: Array, slides: NDArray[np.bool_]) -> None:
    widest = np.where(slides, 0.0, np.abs(angles).max(axis=0))
    joint = int(widest.argmax())
    if widest[joint] > MANY_TURNS:
        raise RecordError(
            f"{path}: {names[joint]} goes to {widest[joint]:.4g}, which looks like degrees "
            f"(allowed: rad, at most {MANY_TURNS:g})"
        )


def _refuse_other_speeds(path: Path, columns: dict[str, list[str]], times: Array, angles: Array, speeds: Array) -> None:
    """Speeds that are not how fast the angles change, over a tenth of a second or so. Changes within the noise of the
    sensors say nothing of speeds.
    """
    period = float(np.median(np.diff(times)))
    stride = max(1, round(0.05 / period))
    noise = np.sqrt(2.0) * _noise_of(angles) + np.sqrt(stride) * period * _noise_of(speeds)
    mean = np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * np.diff(times)[:, None], axis=0)
    said, seen = mean[stride::stride] - mean[:-stride:stride], angles[1:][stride::stride] - angles[1:][:-stride:stride]
    for joint in range(angles.shape[1]):
        moving = np.abs(seen[:, joint]) > max(CALM * np.abs(seen[:, joint]).max(), ABOVE_NOISE * noise[joint])
        if not moving.any() or not seen[moving, joint].any():
            continue
        ratio = float(np.median(said[moving, joint] / seen[moving, joint]))
        if not 1.0 / FAR_FROM_ONE < ratio < FAR_FROM_ONE:
            near = (
                abs(np.log(max(abs(ratio), 1e-9) / DEGREES)) < 0.4 or abs(np.log(max(abs(ratio), 1e-9) * DEGREES)) < 0.4
            )
            unit = ", which looks like degrees" if near else ""
            raise RecordError(
                f"{path}: {columns['speed'][joint]} is {ratio:.3g} times how fast {columns['angle'][joint]} changes"
                f"{unit} (allowed: rad and rad/s)"
            )


def _noise_of(read: Array) -> Array:
    """The standard deviation of the noise of each joint (njoint), by what `read` (nrow x njoint) leaves of a parabola:
    third differences have 20 times the variance of the noise.
    """
    return np.asarray(np.sqrt((np.diff(read, n=3, axis=0) ** 2).mean(axis=0) / 20.0), dtype=np.float64)
