"""A UR10e: from one identification log to all later ones without a load, and to a validation log.

Torques are motor currents times the gains of the repository. Both sides pass 7.5 Hz without phase. Rows in which the
arm stands still, at both ends of a log and between points, are not judged: dry friction may then have any size. What is
so with them is said beside.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import metaid
from benchmarks.real.facts import rows_of
from benchmarks.real.judging import (
    ANGLES,
    Log,
    Missed,
    Motion,
    Rows,
    file_torques,
    low_pass,
    missed,
    motion_of,
    mujoco_torques,
)
from benchmarks.real.least_squares import prepared, tuned
from benchmarks.real.lines import Line, Table
from benchmarks.real.printed import judged_rows, printed_and_measured, printed_line
from benchmarks.real.urdf import bare_urdf, with_bodies
from metaid.models import Array
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import LinearModel, arm_model

REPOSITORY = "dynamic_calibration"
DATA, LEARNED = "dataset_ur10e", "ur-20_02_12-40sec_12harm"
VALIDATION = "ur-20_01_17-ptp_10_points"
FIRST = "ur-20_01_31"  # later than this the set-up does not change
GAINS = np.array([14.87, 13.26, 11.13, 10.62, 11.03, 11.47])  # N m/A
YARDSTICK = 7.5  # Hz
CUTOFFS = (3.0, 5.0, 7.5, 10.0, 20.0)  # Hz
CLASSIC = ("viscous", "coulomb", "offset")
STILL = 0.02  # rad/s, below which dry friction is a share of its whole
MOST_BY_FILE, MOST_OF_JOINT_5 = {".py": 0.036, ".xml": 0.06}, 0.10
COVERED = (0.92, 0.98)


def read_log(path: Path) -> Log:
    """A log of the repository: time, angles, speeds and currents of six joints, then more."""
    rows = np.loadtxt(path, delimiter=",")
    rows = rows[np.r_[True, np.diff(rows[:, 0]) > 0.0]]
    times = rows[:, 0] - rows[0, 0]
    return Log(path.stem, times, rows[:, 1:7], rows[:, 13:19] * GAINS, rows[:, 7:13])


def read_published(path: Path) -> dict[str, Array]:
    """The numbers of UR10E_parameters.txt by their names."""
    found = re.findall(r"^(\w+) = \[([^\]]*)\]", path.read_text(encoding="utf-8"), re.MULTILINE)
    return {name: np.array(numbers.split(), dtype=np.float64) for name, numbers in found}


@dataclass(frozen=True)
class Test:
    """A motion that is predicted, and which of its rows (nrow) count."""

    motion: Motion
    rows: Rows

    def pair(self, torques: Array, measured: Array | None = None) -> tuple[Array, Array]:
        """Predicted torques (nrow x njoint) through the filter, and the measured ones, of the rows that count."""
        sent = self.motion.torques if measured is None else measured
        return low_pass(torques, YARDSTICK, self.motion.period)[self.rows], sent[self.rows]

    @property
    def with_rest(self) -> Test:
        return Test(self.motion, np.ones_like(self.rows))


def read_test(log: Log) -> Test:
    """A log that is predicted."""
    motion = motion_of(log, ANGLES, YARDSTICK)
    return Test(motion, judged_rows(log, motion))


def file_error(path: Path, tests: Sequence[Test]) -> Missed:
    """That of a file that metaid wrote."""
    return missed([test.pair(file_torques(path, test.motion)) for test in tests])


def published_error(model: Any, given: dict[str, Array], tests: Sequence[Test]) -> Missed:
    """That of the published bodies, drives and friction, of currents times the gains that they were found with."""
    model = with_bodies(model, given["pi_rgd"].reshape(6, 10))
    viscous, coulomb, offset = given["pi_frcn"].reshape(6, 3).T
    pairs = []
    for test in tests:
        motion = test.motion
        torques = mujoco_torques(model, motion) + given["pi_drvs"] * motion.accelerations
        torques += viscous * motion.speeds + coulomb * np.sign(motion.speeds) + offset
        pairs.append(test.pair(torques, motion.torques * given["drvGains"] / GAINS))
    return missed(pairs)


def nominal_error(model: Any, learned: Test, tests: Sequence[Test]) -> Missed:
    """That of the bodies of the URDF, with friction that is fitted to what they leave of one log."""

    def friction(speeds: Array) -> Array:
        return np.stack([speeds, np.clip(speeds / STILL, -1.0, 1.0), np.ones_like(speeds)], axis=-1)

    predicted, sent = learned.pair(mujoco_torques(model, learned.motion))
    speeds = learned.motion.speeds
    columns = np.stack([learned.pair(each)[0] for each in np.moveaxis(friction(speeds), -1, 0)], axis=-1)
    left = sent - predicted
    values = [np.linalg.lstsq(columns[:, joint], left[:, joint], rcond=None)[0] for joint in range(6)]
    return missed([
        test.pair(mujoco_torques(model, test.motion) + np.einsum("njt,jt->nj", friction(test.motion.speeds), values))
        for test in tests
    ])  # fmt: skip


def rivals(models: dict[str, LinearModel], learned: Log, tests: Sequence[Test]) -> dict[str, tuple[str, Missed]]:
    """Of each model's terms the filter and weights of least squares that are best on the logs that are predicted."""
    best = {}
    for terms, model in models.items():
        candidates = dict(tuned(model, [learned], CUTOFFS))
        pairs: dict[str, list[tuple[Array, Array]]] = {name: [] for name in candidates}
        for test in tests:
            part = prepared(model, test.motion)
            for name, values in candidates.items():
                pairs[name].append(test.pair(part.predicted(values)))
        errors = {name: missed(each) for name, each in pairs.items()}
        best[terms] = min(errors.items(), key=lambda each: each[1].relative)
    return best


def covered(results: Sequence[Any]) -> tuple[float, int]:
    """In which share of parameters and pairs of logs the 95 % interval of their difference, by `sd`, holds 0."""
    said = [{each["name"]: (each["value"], each["sd"]) for each in result.summary["parameters"]} for result in results]
    held = []
    for one, other in combinations(said, 2):
        for name in one.keys() & other.keys():
            (first, sd), (second, other_sd) = one[name], other[name]
            if sd and other_sd:
                held.append(abs(first - second) <= 1.96 * np.hypot(sd, other_sd))
    return float(np.mean(held)), len(held)


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; CSV and model files are written to a `place`."""
    paths = sorted((folder / DATA / "identification_data").glob("*.csv"))
    paths = [path for path in paths if path.stem >= FIRST and "load" not in path.stem.lower().replace("unload", "")]
    logs = {path.stem: read_log(path) for path in (*paths, folder / DATA / "validation_data" / f"{VALIDATION}.csv")}
    urdf = bare_urdf(folder / "URe" / "urdf" / "ur10e.urdf", place)
    learned = logs.pop(LEARNED)
    result = metaid.estimate(learned.write(place), urdf)
    files = {ending: place / f"ur10e{ending}" for ending in MOST_BY_FILE}
    for path in files.values():
        result.model.write(path)
    tests = [read_test(log) for log in logs.values()]
    found = {f"metaid, {ending}": file_error(path, tests) for ending, path in files.items()}
    found["metaid, .py, with rest"] = file_error(files[".py"], [test.with_rest for test in tests])
    plain, terms = mujoco.MjModel.from_xml_path(str(urdf)), result.estimate.model
    found["URDF and fitted friction"] = nominal_error(plain, read_test(learned), tests)
    found["published, own gains"] = published_error(plain, read_published(folder / "UR10E_parameters.txt"), tests)
    arm = load_plant(urdf)
    assert isinstance(arm, ArmPlant)
    classic = arm_model(arm.tree, CLASSIC).with_still(np.full(6, STILL))
    others = rivals({"classic terms": classic, "metaid's terms": terms}, learned, tests)
    found |= {f"least squares, {name}, {how}": each for name, (how, each) in others.items()}
    title = f"UR10e, torque at {YARDSTICK} Hz, {LEARNED} to {len(tests)} others: {result.verdict.word}"
    yield Table(f"{title}; terms {' '.join(terms.terms)}", [_row(name, each) for name, each in found.items()])
    printed = [printed_and_measured(result, path, [learned]) for path in files.values()]
    yield Table("UR10e, errors that are printed", printed)
    yield printed_line("UR10e", printed)
    for ending, most in MOST_BY_FILE.items():
        yield Line(f"UR10e: torque by the {ending}", found[f"metaid, {ending}"].relative, most)
    yield Line("UR10e: joint 5 by the .py", found["metaid, .py"].by_joint[4], MOST_OF_JOINT_5)
    best = min(each.relative for _, each in others.values())
    yield Line("UR10e: .py beside tuned least squares", found["metaid, .py"].relative / best, 1.02)
    yield Table("UR10e, facts made wrong", list(rows_of(learned.frame, urdf, arm.tree.names, GAINS)))
    yield from coverage([result, *(metaid.estimate(log.frame, urdf) for log in logs.values())])


def _row(name: str, found: Missed) -> dict[str, str]:
    joints = {f"joint {joint}": f"{share:.1%}" for joint, share in enumerate(found.by_joint, 1)}
    return {"model": name, "all": f"{found.relative:.2%}"} | joints


def coverage(results: Sequence[Any]) -> Iterator[Table | Line]:
    """How often intervals of two logs hold."""
    share, count = covered(results)
    words = [result.verdict.word for result in results]
    rows = [
        {"logs": len(results), "pairs and parameters": count, "held": f"{share:.1%}"}
        | {word: words.count(word) for word in sorted(set(words))}
    ]
    yield Table("UR10e, intervals of 95 % between logs, by `sd`", rows)
    yield Line("UR10e: share of intervals that hold, low side", share, COVERED[0], at_least=True)
    yield Line("UR10e: share of intervals that hold, high side", share, COVERED[1])
