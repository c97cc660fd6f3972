"""Logs as their users have them, cleaned: each a run of a robot, or several where its clock or a gap parts it.

Formats, columns, times and repairs have a module each. A log that cannot be used is refused before anything is computed
from it, in one line that says where it is wrong; whatever is repaired is said.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.errors import RecordError
from metaid.models import Array
from metaid.recorded.reading.clock import on_true_clock
from metaid.recorded.reading.columns import Understood, driver_alone, joints_beside, understood
from metaid.recorded.reading.formats import tables_of
from metaid.recorded.reading.merging import lacking, merged, sampled_at
from metaid.recorded.reading.nameless import called_as_file, marked, recognised, refusal
from metaid.recorded.reading.plausible import refuse_degrees, refuse_few_rows, refuse_other_speeds
from metaid.recorded.reading.readings import NO_READING, LogRun, counted
from metaid.recorded.reading.repairs import rested, tamed, unwrapped, with_signs, without_head, without_repeats
from metaid.recorded.reading.times import begins_again, in_order, in_seconds, numeric_times, runs_of

MOST_NAMED = 8  # columns, in a message
FEW_LEFT = 0.5  # of the rows: with more that lack a number, a log is refused


@dataclass(frozen=True)
class Intake:
    """How logs are read.

    Attributes:
        joints: the names of the plant's joints, from the base on.
        slides: which of them (njoint) are slides.
        columns: what columns mean that are not spelled as they are understood: `time`, `angle_1`, `torque_elbow`, ….
        topic: of a bag that has several.
        untrusted: which joints (njoint) move, but their torques are not used.
        endless: which joints (njoint) turn without an end.
        needs_torques: whether the torques must be in it; where not, and they are missing, they are 0.
        may_swing: whether the robot is a pendulum: where no log has torques, or all are 0, it swings freely.
        rate: rows a second of logs without times, or whose times count rows; None: logs have times.
        names: by the path of a log what it is called; where there is none its file is.
    """

    joints: Sequence[str]
    slides: NDArray[np.bool_]
    columns: Mapping[str, str] = field(default_factory=dict)
    topic: str | None = None
    untrusted: NDArray[np.bool_] | bool = False
    endless: NDArray[np.bool_] | bool = False
    needs_torques: bool = True
    may_swing: bool = False
    rate: float | None = None
    names: Mapping[str, str] = field(default_factory=dict)

    def pieces(self, log: str | Path | pd.DataFrame, number: int) -> list[Understood]:
        """The tables in a log, of a bag one a topic; a frame has its `number` as its name.  Raises as `every_run`."""
        count = len(self.joints)
        tables = [called_as_file(marked(table), count) for table in tables_of(log, number, self.topic)]
        said = {*self.columns, *self.columns.values()}
        tables = [
            table if table.is_called(said) else recognised(table, count, self.rate, self.may_swing) for table in tables
        ]
        pieces = [understood(table, self.joints, self.slides, self.columns) for table in tables]
        return pieces if self.rate is None else [piece.on_rate(self.rate) for piece in pieces]

    def run_of(self, pieces: Sequence[Understood]) -> tuple[LogRun, ...]:
        """The runs in tables, of which one has all that is needed, or all together.  Raises RecordError."""
        piece = self._complete(pieces)
        readings = in_seconds(self._measured(piece), piece.unit)
        refuse_few_rows(readings)
        name = self.names.get(piece.table.name, Path(piece.table.name).name)
        parts = begins_again(readings)
        if len(parts) > 1:
            text = f"the clock was set back {counted(len(parts) - 1, 'time')}: {len(parts)} runs"
            parts = [part.repaired("clock", len(parts) - 1, text) if part is parts[0] else part for part in parts]
        runs = [run for part in parts for run in self._runs(part, piece.radians)]
        return tuple(replace(run, name=f"{name}[{i}]" if len(runs) > 1 else name) for i, run in enumerate(runs, 1))

    def _complete(self, every: Sequence[Understood]) -> Understood:
        """The one table that has all that is needed, or what all make together.  Raises RecordError."""
        whole = [piece for piece in every if lacking([piece], self.needs_torques) is None]
        if len(whole) == 1:
            return whole[0]
        if whole:
            names = ", ".join(str(piece.table.topic) for piece in whole)
            raise RecordError(f"{whole[0].table.name}: several have all that is needed (allowed: --topic, of {names})")
        table, missing = every[0].table, lacking(every, self.needs_torques)
        if missing is None:
            return merged(every)
        if table.is_nameless:
            raise refusal(table, len(self.joints))
        there = ", ".join(table.columns[:MOST_NAMED]) + (", …" if len(table.columns) > MOST_NAMED else "")
        strange = joints_beside("angle", table.columns) if missing == "angle" else []
        told = f"--map {strange[0]}={self.joints[0]}" if len(strange) == len(self.joints) else "--map OWN=OURS"
        of = f" of each of {len(self.joints)} joints" if len(self.joints) > 1 else ""
        name, rate = ("time", "; or --rate HZ where rows are regular") if missing == "time" else (f"{missing}_1", "")
        raise RecordError(
            f"{table.name}: no column '{name}' among {there} (allowed: time,{of} angle_1, torque_1 and perhaps speed_1"
            f"{rate}; or {told})"
        )

    def _measured(self, piece: Understood) -> LogRun:
        """The cells of a table as numbers; where all torques are 0, those of others that may be torques and are not."""
        readings = self._numbers(piece)
        for word in piece.others if self.needs_torques and not readings.torques.any() else ():
            mapping = {**self.columns, word: "torque"}
            other = self._numbers(understood(piece.table, self.joints, self.slides, mapping))
            if other.torques.any():
                return other.repaired("torque", 1, f"torques are 0: {word} is read instead, as by --map {word}=torque")
        if self.may_swing and not piece.kinds["torque"]:
            told = f"{own}=torque_JOINT" if (own := driver_alone(piece.table.columns)) else "OWN=torque"
            text = f"no torques: taken to swing freely (--map {told} where a motor moves it)"
            readings = readings.repaired("torque", len(self.joints), text)
        return readings

    def _numbers(self, piece: Understood) -> LogRun:
        """The cells of a table as numbers, NaN where a cell has none."""
        frame, names, factors = piece.load(), piece.kinds, piece.factors
        angles = _numbers(frame, names["angle"], factors)
        speeds = _numbers(frame, names["speed"], factors) if any(names["speed"]) else None
        torques = _numbers(frame, names["torque"] or [""] * len(self.joints), factors)
        torques = np.where(self.untrusted, 0.0, torques)
        times = numeric_times([frame[each] for each in piece.times])
        return LogRun(piece.table.name, times, angles, speeds, torques, piece.notes, names=names)

    def _runs(self, readings: LogRun, radians: frozenset[str]) -> list[LogRun]:
        """The runs of a log, repaired, in the order of time, and plausible."""
        readings = in_order(_without_holes(without_head(_at_angles(readings))))
        refuse_few_rows(readings)
        readings = replace(readings, times=readings.times - readings.times[0])
        readings = with_signs(without_repeats(unwrapped(tamed(readings), self.slides)))
        timed = [on_true_clock(run) for run in runs_of(readings)]
        for run in timed:
            refuse_few_rows(run)
        runs = [rested(run) for run in timed]
        moving = [run for run in runs if (np.ptp(run.angles, axis=0) > 0.0).any()] or runs
        for run in moving:
            refuse_degrees(run, self.slides, self.endless, radians)
            refuse_other_speeds(run, self.rate)
            if self.needs_torques and not self.may_swing and not run.torques.any():
                raise RecordError(f"{run.name}: every torque is 0, so nothing says how heavy the links are")
            if not (np.ptp(run.angles, axis=0) > 0.0).any():
                raise RecordError(f"{run.name}: no joint moves")
        still = len(runs) - len(moving)
        if still:
            moving[0] = moving[0].repaired("rest", still, f"{counted(still, 'run')} in which no joint moves left out")
        return moving


def _numbers(frame: pd.DataFrame, names: Sequence[str], factors: Mapping[str, float]) -> Array:
    """The cells of the columns of these names (nrow x ncolumn), those of some times `factors`; NaN where one has no
    reading, 0 of an empty name.
    """
    cells = [frame[name] if name else pd.Series(0.0, index=frame.index) for name in names]
    columns = [pd.to_numeric(column, errors="coerce") for column in cells]
    numbers = np.column_stack([column.to_numpy(dtype=np.float64, na_value=np.nan) for column in columns])
    numbers[~(np.abs(numbers) < NO_READING)] = np.nan
    return numbers * [factors.get(name, 1.0) for name in names]


def _at_angles(readings: LogRun) -> LogRun:
    """A log most of whose rows have readings of one topic alone, at the times of the angles: a torque holds until the
    next, speeds are straight between two. Any other as it is.
    """
    if readings.lacks.mean() <= FEW_LEFT:
        return readings
    at_once = np.asarray(np.isfinite(readings.angles).all(axis=1))
    kept, count = readings.rows(at_once), int((~at_once).sum())

    def sampled(kind: str, read: Array) -> Array:
        columns = read.T[..., None]
        return np.hstack([sampled_at(kept.times, readings.times, column, kind == "torque") for column in columns])

    others = {kind: sampled(kind, read) for kind, read in readings.kinds.items() if kind != "angle"}
    return kept.with_kinds(others).repaired(
        "topics", count, f"{counted(count, 'row')} without an angle: torques hold until the next"
    )


def _without_holes(readings: LogRun) -> LogRun:
    """The same without rows in which a cell has no number.  Raises RecordError where these are most."""
    holes = {"time": np.isnan(readings.times)}
    for kind, names in readings.names.items():
        for joint, name in enumerate(names):
            holes[name] = np.isnan(readings.kinds[kind][:, joint])
    bad = np.any(list(holes.values()), axis=0)
    count = int(bad.sum())
    if not count:
        return readings
    worst = max(holes, key=lambda each: int(holes[each].sum()))
    first = next(f"row {row + 1}: {name}" for row in [int(bad.argmax())] for name, own in holes.items() if own[row])
    if count > FEW_LEFT * len(readings):
        raise RecordError(
            f"{readings.name}: {worst} has no number in {holes[worst].mean():.0%} of the rows, the first in {first} "
            f"(allowed: numbers in at least {1.0 - FEW_LEFT:.0%} of the rows)"
        )
    text = f"{counted(count, 'row')} without a number left out, the first {first}"
    return readings.rows(~bad).repaired("no number", count, text)


def short_names(paths: Iterable[str]) -> dict[str, str]:
    """By their paths what logs are called: files, with the folders that tell those of one name apart."""
    every = {path: Path(path).parts for path in paths}
    names = {}
    for path, parts in every.items():
        alike = (sum(other[-count:] == parts[-count:] for other in every.values()) for count in range(1, len(parts)))
        needed = next((count for count, others in enumerate(alike, 1) if others == 1), len(parts))
        names[path] = str(Path(*parts[-needed:]))
    return names


def every_run(intake: Intake, logs: Iterable[str | Path | pd.DataFrame], first: int = 1) -> tuple[LogRun, ...]:
    """The runs in several logs, one after the other. Logs that follow one another and have some kinds of readings each
    are one.

    Their columns are `time` and, of every joint by its number or its name, `angle_1` in rad, `speed_1` in rad/s and
    `torque_1` in N m (of a slide in m, m/s and N), or spelled as people do. All speeds may be missing.

    Args:
        intake: how they are read.
        logs: paths of CSV, Parquet, arrays of MATLAB or NumPy, or bags, or frames.
        first: the number of the first log, for frames, which have no name.

    Raises:
        RecordError: one is not such a log.
        MissingExtraError: a package for its format is not installed.
    """
    every = [intake.pieces(log, number) for number, log in enumerate(logs, first)]
    if intake.may_swing and not any(piece.kinds["torque"] for pieces in every for piece in pieces):
        intake = replace(intake, needs_torques=False)
    runs: list[LogRun] = []
    waiting: list[Understood] = []
    for pieces in every:
        waiting += pieces
        if lacking(waiting, intake.needs_torques) is None:
            runs += intake.run_of(waiting)
            waiting = []
    return (*runs, *(intake.run_of(waiting) if waiting else ()))
