"""A real robot: how well its torques and speeds are predicted from its log, by metaid and by least squares.

    python -m benchmarks.tx40 FOLDER [--json]

FOLDER is `examples/staubli_TX40` of the public repository thanhndv212/figaroh-examples: 9 s of motor positions and
currents of a Stäubli TX40 at 5 kHz, and its URDF. None of it ships with metaid.

The motion is cut into three thirds. Each is predicted by what the other two say. Torque: every 2 ms of motion, relative
to what it is, root mean square over joints; angles and torques pass the same filter, without phase, at 50 Hz. Speed:
0.1 s after states of the log, every 0.05 s, by a simulation under the torques that were logged, relative to how much it
changes. That yardstick is the same for all.

metaid has its defaults; that joints 5 and 6 are coupled is the robot's own fact. figaroh's recipe is its example's:
Butterworth filter at 100 Hz, differences, every tenth row, ordinary or weighted least squares of all rows. Least
squares are tuned, too: rest left out, angles and torques through the same filter at 10 to 100 Hz, rows weighted anew by
joint, or by the covariance across joints. The best of all these at the held-out thirds themselves is the best rival.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from scipy import signal
from threadpoolctl import threadpool_limits

from benchmarks.common import table
from metaid.models import Array
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import LinearModel, Record, arm_model, estimate_record

PERIOD = 2e-4  # s
RATIOS = np.array([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])  # turns of the motors for one of the joints
STRAIGHT = np.array([0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])  # rad, of the joints where the motors are at 0
COUPLED = ((4, 5),)
NO_INERTIA = 'ixx="0.000" ixy="0.000" ixz="0.000" iyy="0.000" iyz="0.000" izz="0.000"'
SMALL_INERTIA = NO_INERTIA.replace('xx="0.000', 'xx="0.0001').replace('yy="0.000', 'yy="0.0001')
SMALL_INERTIA = SMALL_INERTIA.replace('zz="0.000', 'zz="0.0001')  # MuJoCo compiles no link without
YARDSTICK, STRIDE, EDGE = 50.0, 10, 100  # Hz; rows
AHEAD, APART, STEP = 0.1, 0.05, 0.002  # s
STILL = 0.05  # rad/s: at rest
CUTOFFS = (10.0, 20.0, 30.0, 50.0, 100.0)  # Hz
RECIPE = 100.0  # Hz
FRICTIONS = {
    "viscous, Coulomb, offset": ("viscous", "coulomb", "offset"),
    "and root": ("viscous", "coulomb", "root", "offset"),
}
ROUNDS = 4


@dataclass(frozen=True)
class Robot:
    """Its log and the end of its motion, in s."""

    arm: ArmPlant
    record: Record
    end: float

    @property
    def thirds(self) -> list[tuple[float, float]]:
        """From and to, in s."""
        edges = np.linspace(0.0, self.end, 4)
        return [(float(begin), float(end)) for begin, end in pairwise(edges)]


@dataclass(frozen=True)
class Filtered:
    """Angles, speeds, accelerations and torques (nrow x njoint) through one filter, at some times (nrow), in s."""

    times: Array
    angles: Array
    speeds: Array
    accelerations: Array
    torques: Array


def read_robot(folder: Path) -> Robot:
    """The robot whose example lies in a folder."""
    motors, currents = (
        np.loadtxt(folder / "data" / f"{name}.csv", delimiter=",", skiprows=1)
        for name in ("pos_read_data", "curr_data")
    )
    reduction = np.diag(RATIOS)
    reduction[5, 4] = RATIOS[5]  # motor 6 turns with joint 5, too
    angles = motors @ np.linalg.inv(reduction).T + STRAIGHT
    times = PERIOD * np.arange(len(angles), dtype=np.float64)
    record = Record("tx40", times, np.asarray(angles, dtype=np.float64), None, currents @ reduction)
    moving = np.abs(np.diff(angles[::50], axis=0)).max(axis=1) > STILL * 50 * PERIOD
    text = (folder / "urdf" / "tx40_mdh_modified.urdf").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as place:
        urdf = Path(place) / "tx40.urdf"
        urdf.write_text(text.replace(NO_INERTIA, SMALL_INERTIA), encoding="utf-8")
        arm = load_plant(urdf)
    assert isinstance(arm, ArmPlant)
    return Robot(arm, record, float(record.times[50 * (np.flatnonzero(moving)[-1] + 1)]))


def filtered(robot: Robot, cutoff: float, stride: int = STRIDE, rest: bool = False) -> Filtered:
    """The log through a zero-phase Butterworth filter at `cutoff` Hz, every `stride`th row, with the `rest` or not."""
    weights = signal.butter(4, cutoff * 2.0 * PERIOD)
    angles, torques = (signal.filtfilt(*weights, each, axis=0) for each in (robot.record.angles, robot.record.torques))
    speeds = np.gradient(angles, PERIOD, axis=0)
    accelerations = np.gradient(speeds, PERIOD, axis=0)
    last = len(angles) - EDGE if rest else int(robot.end / PERIOD)
    rows = slice(EDGE, last, stride)
    return Filtered(robot.record.times[rows], angles[rows], speeds[rows], accelerations[rows], torques[rows])


def least_squares(rows: Array, torques: Array, weigh: str) -> Array:
    """Unknowns (nparam) from rows (nrow x njoint x nparam) that explain torques (nrow x njoint): weighted not at all,
    `by joint`, or by the covariance `across joints`.
    """
    njoint = torques.shape[1]
    whitening = np.eye(njoint)
    for _ in range(ROUNDS if weigh else 1):
        flat = np.einsum("ij,njp->nip", whitening, rows).reshape(-1, rows.shape[-1])
        scale = np.sqrt((flat**2).sum(axis=0))
        scale[scale == 0.0] = 1.0
        solved = np.linalg.lstsq(flat / scale, (torques @ whitening.T).ravel(), rcond=1e-10)[0] / scale
        left = torques - rows @ solved
        covariance = left.T @ left / len(left)
        kept = covariance if weigh == "across joints" else np.diag(np.diag(covariance))
        whitening = np.linalg.inv(np.linalg.cholesky(kept))
    return np.asarray(solved, dtype=np.float64)


def recipe(robot: Robot, model: LinearModel, weigh: str) -> list[Array]:
    """What figaroh's example would say without each third."""
    log = filtered(robot, RECIPE, stride=1, rest=True)
    rows = model.regressor(log.angles, log.speeds, log.accelerations)
    raw = robot.record.torques[EDGE : EDGE + len(rows)]
    rows = signal.decimate(rows, 10, axis=0, zero_phase=True)
    torques, times = signal.decimate(raw, 10, axis=0, zero_phase=True), log.times[::10]
    outside = [(times < begin) | (times >= end) for begin, end in robot.thirds]
    return [least_squares(rows[each], torques[each], weigh) for each in outside]


def tuned(robot: Robot, model: LinearModel, cutoff: float, weigh: str) -> list[Array]:
    """What least squares say without each third, rest left out."""
    log = filtered(robot, cutoff)
    rows = model.regressor(log.angles, log.speeds, log.accelerations)
    outside = [(log.times < begin) | (log.times >= end) for begin, end in robot.thirds]
    return [least_squares(rows[each], log.torques[each], weigh) for each in outside]


def torque_error(robot: Robot, model: LinearModel, found: list[Array]) -> float:
    """Relative error of the torque of each third by what was found without it."""
    log = filtered(robot, YARDSTICK)
    rows = model.regressor(log.angles, log.speeds, log.accelerations)
    left = log.torques.copy()
    for (begin, end), values in zip(robot.thirds, found, strict=True):
        inside = (log.times >= begin) & (log.times < end)
        left[inside] -= rows[inside] @ values
    return float(np.linalg.norm(left) / np.linalg.norm(log.torques))


def speed_error(robot: Robot, model: LinearModel, found: list[Array]) -> float:
    """Relative error of how speeds change in AHEAD s, in each third by what was found without it."""
    log = filtered(robot, YARDSTICK, stride=1)
    rows, steps = round(AHEAD / PERIOD), round(AHEAD / STEP)
    starts, values = [], []
    for (begin, end), each in zip(robot.thirds, found, strict=True):
        own = np.arange(max(begin, log.times[0]), min(end, log.times[-1]) - AHEAD, APART)
        starts.append(np.round((own - log.times[0]) / PERIOD).astype(np.intp))
        values.append(np.repeat(each[None], len(own), axis=0))
    first, unknowns = np.concatenate(starts), np.concatenate(values)
    sent = robot.record.torques[EDGE + first[:, None] + np.arange(rows)]
    sent = sent.reshape(len(first), steps, rows // steps, -1).mean(axis=2)
    angles, speeds = log.angles[first], log.speeds[first]
    for step in range(steps):
        rate = _accelerations(model, unknowns, angles, speeds, sent[:, step])
        half = angles + 0.5 * STEP * speeds, speeds + 0.5 * STEP * rate
        rate = _accelerations(model, unknowns, *half, sent[:, step])
        angles, speeds = angles + STEP * half[1], speeds + STEP * rate
    seen = log.speeds[first + rows]
    return float(np.linalg.norm(speeds - seen) / np.linalg.norm(seen - log.speeds[first]))


def _accelerations(model: LinearModel, unknowns: Array, angles: Array, speeds: Array, torques: Array) -> Array:
    """What torques (nstate x njoint) accelerate joints by, each state by its own unknowns (nstate x nparam)."""
    n = model.njoint
    each = np.vstack([np.zeros(n), np.eye(n)])
    shape = (len(angles), n + 1, n)
    where, moving = (np.broadcast_to(part[:, None], shape) for part in (angles, speeds))
    rows = model.regressor(where, moving, np.broadcast_to(each, shape))
    needed = np.einsum("skjp,sp->skj", rows, unknowns)
    matrices = (needed[:, 1:] - needed[:, :1]).swapaxes(-1, -2)
    return np.asarray(np.linalg.solve(matrices, (torques - needed[:, 0])[..., None])[..., 0], dtype=np.float64)


def methods(robot: Robot, friction: tuple[str, ...]) -> Iterator[tuple[str, float, LinearModel, list[Array]]]:
    """Name, seconds of one estimate from all of the log, model and what was found without each third."""
    model = arm_model(robot.arm.tree, friction, COUPLED)
    begun = time.process_time()
    still = estimate_record(robot.record, model).model
    seconds = time.process_time() - begun
    yield "metaid", seconds, still, [estimate_record(robot.record, model, without=part).values for part in robot.thirds]
    for weigh in ("", "by joint"):
        begun = time.process_time()
        found = recipe(robot, still, weigh)
        name = "figaroh's recipe" + (", weighted" if weigh else "")
        yield name, (time.process_time() - begun) / 3.0, still, found
    for weigh in ("", "by joint", "across joints"):
        for cutoff in CUTOFFS:
            begun = time.process_time()
            found = tuned(robot, still, cutoff, weigh)
            name = f"least squares, {cutoff:g} Hz" + (f", weighted {weigh}" if weigh else "")
            yield name, (time.process_time() - begun) / 3.0, still, found


def main() -> None:
    """Every method with either set of friction terms."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tx40", description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="examples/staubli_TX40 of thanhndv212/figaroh-examples")
    parser.add_argument("--json", action="store_true", help="print JSON")
    given = parser.parse_args()
    with threadpool_limits(1):
        robot = read_robot(given.folder)
        rows: list[dict[str, Any]] = []
        for terms, friction in FRICTIONS.items():
            for name, seconds, model, found in methods(robot, friction):
                errors = torque_error(robot, model, found), speed_error(robot, model, found)
                rows.append(
                    {"friction": terms, "method": name, "torque": errors[0], "speed": errors[1], "seconds": seconds}
                )
    if given.json:
        print(json.dumps(rows, indent=2))
        return
    shown = [
        {
            "friction": row["friction"],
            "method": row["method"],
            "torque, held out": f"{row['torque']:.2%}",
            "speed over 0.1 s": f"{row['speed']:.1%}",
            "seconds": f"{row['seconds']:.1f}",
        }
        for row in rows
    ]
    print(table(shown))
    for terms in FRICTIONS:
        ours, *others = [row for row in rows if row["friction"] == terms]
        said = []
        for key in ("torque", "speed"):
            best = min(others, key=itemgetter(key))
            said.append(f"{key} {ours[key] / best[key]:.3f} times that of the best rival, {best['method']}")
        print(f"{terms}: {'; '.join(said)}")


if __name__ == "__main__":
    main()
