"""A Stäubli TX40: 9 s at 5 kHz, in three thirds; each is predicted by what the other two say.

Torque: every 2 ms of motion, angles and torques through the same filter without phase at 50 Hz. Speed: 0.1 s after
states of the log, every 0.05 s, by a simulation under the torques that were logged, relative to how much it changes.
figaroh's recipe is its example's: Butterworth filter at 100 Hz, differences, every tenth row, ordinary or weighted
least squares of all rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy import signal

import metaid
from benchmarks.real.judging import (
    Log,
    Motion,
    Rows,
    file_torques,
    free_model,
    held,
    missed,
    motion_of,
    simulated,
    simulated_by_law,
)
from benchmarks.real.least_squares import WEIGHTS, Prepared, fitted, prepared, solve
from benchmarks.real.lines import Line, Table
from benchmarks.real.printed import printed_and_measured, printed_line
from benchmarks.real.urdf import bare_urdf
from metaid.models import Array
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import LinearModel, arm_model

REPOSITORY = "figaroh-examples"
EXAMPLE = Path("examples") / "staubli_TX40"
PERIOD = 2e-4  # s
RATIOS = np.array([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])  # turns of the motors for one of the joints
STRAIGHT = np.array([0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])  # rad, of the joints where the motors are at 0
COUPLED = (4, 5)
YARDSTICK, STRIDE, EDGE, RECIPE = 50.0, 10, 100, 100.0  # Hz; rows; rows; Hz
AHEAD, APART, STEP = 0.1, 0.05, 0.002  # s
STILL = 0.05  # rad/s: at rest
CUTOFFS = (10.0, 20.0, 30.0, 50.0, 100.0)  # Hz
TERMS = {"classic terms": ("viscous", "coulomb", "offset"), "and root": ("viscous", "coulomb", "root", "offset")}
MOST = {".py": 0.061, ".xml": 0.083, "speed": 0.221}
Part = tuple[float, float]
Found = tuple[str, float, float | None]  # name, error of torque, of speed
Speeds = Callable[[int, Array, Array, Array], Array]  # after AHEAD s, of angles, speeds (nstart x njoint) and times


@dataclass(frozen=True)
class Robot:
    """Its log, the end of its motion in s, and what it is judged by."""

    log: Log
    end: float
    yardstick: Motion
    dense: Motion

    @property
    def thirds(self) -> list[Part]:
        return [(float(begin), float(end)) for begin, end in pairwise(np.linspace(0.0, self.end, 4))]

    def outside(self, motion: Motion, number: int) -> Rows:
        """Which rows of a motion (nrow) are not in a third, and not at rest after the end."""
        begin, end = self.thirds[number]
        moves = (motion.times >= EDGE * PERIOD) & (motion.times < self.end)
        return moves & ~((motion.times >= begin) & (motion.times < end))

    def torque_error(self, torques: list[Array]) -> float:
        """Relative error in the thirds of torques along the whole yardstick (3 of nrow x njoint)."""
        motion, pairs = self.yardstick, []
        for number, (begin, end) in enumerate(self.thirds):
            inside = (motion.times >= max(begin, EDGE * PERIOD)) & (motion.times < end)
            pairs.append((torques[number][inside], motion.torques[inside]))
        return missed(pairs).relative

    def speed_error(self, after: Speeds) -> float:
        """Relative error of how speeds change in AHEAD s, in the thirds."""
        left, changed = [], []
        for number, (begin, end) in enumerate(self.thirds):
            starts = np.arange(max(begin, EDGE * PERIOD), end - AHEAD, APART)
            rows = np.round(starts / PERIOD).astype(np.intp)
            seen = self.dense.speeds[rows + round(AHEAD / PERIOD)]
            begun = self.dense.speeds[rows]
            left.append(after(number, self.dense.angles[rows], begun, self.dense.times[rows]) - seen)
            changed.append(seen - begun)
        return float(np.linalg.norm(np.concatenate(left)) / np.linalg.norm(np.concatenate(changed)))


def read_robot(folder: Path) -> Robot:
    """The robot whose example lies in a folder."""
    motors, currents = (
        np.loadtxt(folder / "data" / f"{name}.csv", delimiter=",", skiprows=1)
        for name in ("pos_read_data", "curr_data")
    )
    reduction = np.diag(RATIOS)
    reduction[5, 4] = RATIOS[5]  # motor 6 turns with joint 5, too
    angles = motors @ np.linalg.inv(reduction).T + STRAIGHT
    log = Log("tx40", PERIOD * np.arange(len(angles), dtype=np.float64), angles, currents @ reduction)
    moving = np.abs(np.diff(angles[::50], axis=0)).max(axis=1) > STILL * 50 * PERIOD
    end = float(log.times[50 * (np.flatnonzero(moving)[-1] + 1)])
    dense = motion_of(log, YARDSTICK)
    every = slice(0, None, STRIDE)
    parts = (dense.times, dense.angles, dense.speeds, dense.accelerations, dense.torques)
    return Robot(log, end, Motion(*(part[every] for part in parts)), dense)


def runs_without(robot: Robot, number: int) -> list[Log]:
    """The log without a third, as runs of their own; the rest at its end belongs to the last third."""
    begin, end = robot.thirds[number]
    runs = [robot.log.rows(robot.log.times < begin)]
    if number < len(robot.thirds) - 1:
        runs.append(robot.log.rows(robot.log.times >= end))
    return [run for run in runs if len(run.times)]


def by_files(robot: Robot, files: list[Path]) -> tuple[float, float]:
    """Errors of torque and of speed, by a file of each third."""
    torque = robot.torque_error([file_torques(path, robot.yardstick) for path in files])
    if files[0].suffix == ".py":
        return torque, robot.speed_error(
            lambda number, angles, speeds, starts: simulated_by_law(
                files[number], robot.dense, np.round(starts / PERIOD).astype(np.intp), robot.log, AHEAD
            )
        )
    models = [free_model(path) for path in files]
    speed = robot.speed_error(
        lambda number, angles, speeds, starts: simulated(models[number], angles, speeds, robot.log, starts, AHEAD)[1]
    )
    return torque, speed


def speed_by_values(robot: Robot, models: list[LinearModel], values: list[Array]) -> float | None:
    """Error of speed by unknowns (nparam) found without each third; None of terms that have a past."""
    if any("load" in model.friction or model.sliding.builds_up for model in models):
        return None

    def after(number: int, angles: Array, speeds: Array, starts: Array) -> Array:
        for step in range(round(AHEAD / STEP)):
            sent = held(robot.log, starts[:, None] + STEP * step + PERIOD * np.arange(STRIDE)).mean(axis=1)
            rate = _accelerations(models[number], values[number], angles, speeds, sent)
            half = angles + 0.5 * STEP * speeds, speeds + 0.5 * STEP * rate
            rate = _accelerations(models[number], values[number], *half, sent)
            angles, speeds = angles + STEP * half[1], speeds + STEP * rate
        return speeds

    return robot.speed_error(after)


def _accelerations(model: LinearModel, unknowns: Array, angles: Array, speeds: Array, torques: Array) -> Array:
    """What torques (nstate x njoint) accelerate joints by."""
    n = model.njoint
    each, shape = np.vstack([np.zeros(n), np.eye(n)]), (len(angles), n + 1, n)
    where, moving = (np.broadcast_to(part[:, None], shape) for part in (angles, speeds))
    needed = model.regressor(where, moving, np.broadcast_to(each, shape)) @ unknowns
    matrices = (needed[:, 1:] - needed[:, :1]).swapaxes(-1, -2)
    return np.asarray(np.linalg.solve(matrices, (torques - needed[:, 0])[..., None])[..., 0], dtype=np.float64)


def recipe(robot: Robot, model: LinearModel, weigh: str) -> list[Array]:
    """What figaroh's example would say without each third."""
    motion = motion_of(robot.log, RECIPE)
    rows = signal.decimate(prepared(model, motion).design(motion.torques), STRIDE, axis=0, zero_phase=True)
    torques = signal.decimate(robot.log.torques[: len(motion.times)], STRIDE, axis=0, zero_phase=True)
    times, found = motion.times[::STRIDE], []
    for begin, end in robot.thirds:
        outside = (times >= EDGE * PERIOD) & ((times < begin) | (times >= end))
        found.append(solve(rows[outside], torques[outside], weigh))
    return found


def tuned(robot: Robot, models: list[LinearModel]) -> Iterator[tuple[str, list[Array]]]:
    """Name and unknowns without each third of every filter and weight, rest left out."""
    for cutoff in CUTOFFS:
        motion = motion_of(robot.log, cutoff, finest=STRIDE * PERIOD)
        parts = [prepared(model, motion) for model in models]
        kept = [robot.outside(motion, number) for number in range(3)]
        for weigh in WEIGHTS:
            name = f"least squares, {cutoff:g} Hz" + (f", weighted {weigh}" if weigh else "")
            yield name, [fitted([part], [rows], weigh) for part, rows in zip(parts, kept, strict=True)]


def rivals(robot: Robot, terms: dict[str, list[LinearModel]]) -> Iterator[Found]:
    """Name, error of torque and of speed of the best least squares and of figaroh's recipe, by each model's terms."""
    for each, models in terms.items():
        yardsticks = [prepared(model, robot.yardstick) for model in models]

        def torque_error(values: list[Array], yardsticks: list[Prepared] = yardsticks) -> float:
            return robot.torque_error([part.predicted(own) for part, own in zip(yardsticks, values, strict=True)])

        found = {name: (torque_error(values), values) for name, values in tuned(robot, models)}
        name, (torque, values) = min(found.items(), key=lambda one: one[1][0])
        yield f"{name}, {each}", torque, speed_by_values(robot, models, values)
        for weigh in WEIGHTS[:2] if each in TERMS else ():
            values = recipe(robot, models[0], weigh)
            name = f"figaroh's recipe{', weighted' if weigh else ''}, {each}"
            yield name, torque_error(values), speed_by_values(robot, models, values)


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    robot = read_robot(folder / EXAMPLE)
    urdf = bare_urdf(folder / EXAMPLE / "urdf" / "tx40_mdh_modified.urdf", place)
    files: dict[str, list[Path]] = {".py": [], ".xml": []}
    printed, words, own = [], [], []
    for number in range(3):
        runs = runs_without(robot, number)
        result = metaid.estimate([run.frame for run in runs], urdf, coupled=[(COUPLED[0] + 1, COUPLED[1] + 1)])
        words.append(result.verdict.word)
        own.append(result.estimate.model)
        for ending, paths in files.items():
            paths.append(place / f"tx40_{number}{ending}")
            result.model.write(paths[-1])
            printed.append({"third": number + 1} | printed_and_measured(result, paths[-1], runs))
    ours = {ending: by_files(robot, paths) for ending, paths in files.items()}
    arm = load_plant(urdf)
    assert isinstance(arm, ArmPlant)
    usual = arm_model(arm.tree).with_coupled((COUPLED,)).with_still(np.full(6, 0.02))
    terms = {name: [usual.with_friction(each)] * 3 for name, each in TERMS.items()}
    others = list(rivals(robot, terms | {"metaid's terms": own}))
    found: list[Found] = [(f"metaid, {ending}", *errors) for ending, errors in ours.items()]
    taken = "; ".join(" ".join(model.terms) for model in own)
    yield Table(f"TX40, thirds held out: {', '.join(words)}; terms {taken}", [_row(*each) for each in found + others])
    yield Table("TX40, errors that are printed", printed)
    yield printed_line("TX40", printed)
    yield from lines(ours, min(torque for _, torque, _ in others))


def lines(ours: dict[str, tuple[float, float]], best: float) -> Iterator[Line]:
    """What issue 28 asks of it; speed by the file that holds all terms."""
    for ending, (torque, _) in ours.items():
        yield Line(f"TX40: torque by the {ending}", torque, MOST[ending])
    yield Line(f"TX40: speed over {AHEAD} s by the .py", ours[".py"][1], MOST["speed"])
    yield Line("TX40: .py beside tuned least squares", ours[".py"][0] / best, 1.02)


def _row(name: str, torque: float, speed: float | None) -> dict[str, str | None]:
    return {"model": name, "torque": f"{torque:.2%}", "speed over 0.1 s": None if speed is None else f"{speed:.1%}"}
