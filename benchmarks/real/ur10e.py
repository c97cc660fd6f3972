"""A UR10e: from one identification log to all later ones without a load, and to a validation log.

Torques are motor currents times the gains of the repository. Both sides pass 7.5 Hz without phase. Rows in which the
arm stands still, at both ends of a log and between points, are not judged: dry friction may then have any size. What is
so with them is said beside.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import metaid
from benchmarks.real.facts import rows_of
from benchmarks.real.judging import Log, Missed, missed, mujoco_torques
from benchmarks.real.lines import Line, Table
from benchmarks.real.printed import printed_and_measured, printed_line
from benchmarks.real.torques import (
    CLASSIC,
    STILL,
    YARDSTICK,
    Test,
    file_error,
    nominal_error,
    read_test,
    recipes,
    rivals,
    row_of,
)
from benchmarks.real.urdf import bare_urdf, with_bodies
from metaid.models import Array
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import Payload, arm_model

REPOSITORY = "dynamic_calibration"
DATA, LEARNED = "dataset_ur10e", "ur-20_02_12-40sec_12harm"
VALIDATION = "ur-20_01_17-ptp_10_points"
FIRST = "ur-20_01_31"  # later than this the set-up does not change
GAINS = np.array([14.87, 13.26, 11.13, 10.62, 11.03, 11.47])  # N m/A
MOST_BY_FILE, MOST_OF_JOINT_5 = {".py": 0.036, ".xml": 0.06}, 0.10
COVERED = (0.92, 0.98)
FREE, LOADED, LOAD = "ur-20_02_19_14harm50sec", "ur-20_02_19_14harm50secLoad", 2.805  # kg, of estimate_drive_gains.m
GAIN_JOINTS, MOST_OF_GAIN = (1, 2), 0.12  # joints 2 and 3


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


def gains(folder: Path, urdf: Path) -> Iterator[Table | Line]:
    """The gains of the drives, of currents, from a log without and one with a payload whose mass alone is known."""
    free, loaded = (read_log(folder / DATA / "identification_data" / f"{name}.csv") for name in (FREE, LOADED))
    currents = [replace(log, torques=log.torques / GAINS).frame for log in (free, loaded)]
    result = metaid.estimate(currents[0], urdf, payloads=[Payload(currents[1], LOAD)])
    rows = result.summary["gains"]
    title = f"UR10e, gains of the drives, N m/A, by {LOAD} kg: {result.verdict.word}"
    yield Table(
        title,
        [
            {
                "joint": row["joint"],
                "gain": f"{row['gain']:.2f}",
                "95 %": f"{row['low']:.2f} to {row['high']:.2f}",
                "told": "yes" if row["determined"] else "no",
                "published": f"{gain:.2f}",
            }
            for row, gain in zip(rows, GAINS, strict=True)
        ],
    )
    for joint in GAIN_JOINTS:
        off = abs(rows[joint]["gain"] / GAINS[joint] - 1.0)
        yield Line(f"UR10e: gain of joint {joint + 1} beside the published one, relative difference", off, MOST_OF_GAIN)
    inside = [row["low"] <= gain <= row["high"] for row, gain in zip(rows, GAINS, strict=True)]
    yield Line("UR10e: intervals of gains that hold the published one", float(sum(inside)), 6.0, at_least=True)
    unsure = [row["sd"] / row["gain"] for row in rows if not row["determined"]]
    yield Line("UR10e: least relative deviation of a gain that is not told", min(unsure), 0.1, at_least=True)


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
    found["URDF and fitted friction"] = nominal_error(plain, [read_test(learned)], tests)
    found["published, own gains"] = published_error(plain, read_published(folder / "UR10E_parameters.txt"), tests)
    arm = load_plant(urdf)
    assert isinstance(arm, ArmPlant)
    classic = arm_model(arm.tree).with_friction(CLASSIC).with_still(np.full(6, STILL))
    others = rivals({"classic terms": classic, "metaid's terms": terms}, [learned], tests)
    found |= {f"least squares, {name}, {how}": each for name, (how, each) in others.items()}
    found |= recipes(classic, [learned], tests)
    title = f"UR10e, torque at {YARDSTICK} Hz, {LEARNED} to {len(tests)} others: {result.verdict.word}"
    yield Table(f"{title}; terms {' '.join(terms.terms)}", [row_of(name, each) for name, each in found.items()])
    printed = [printed_and_measured(result, path, [learned]) for path in files.values()]
    yield Table("UR10e, errors that are printed", printed)
    yield printed_line("UR10e", printed)
    for ending, most in MOST_BY_FILE.items():
        yield Line(f"UR10e: torque by the {ending}", found[f"metaid, {ending}"].relative, most)
    yield Line("UR10e: joint 5 by the .py", found["metaid, .py"].by_joint[4], MOST_OF_JOINT_5)
    best = min(each.relative for _, each in others.values())
    yield Line("UR10e: .py beside tuned least squares", found["metaid, .py"].relative / best, 1.02)
    yield Table("UR10e, facts made wrong", list(rows_of(learned.frame, urdf, arm.tree.names, GAINS)))
    yield from gains(folder, urdf)
    yield from coverage([result, *(metaid.estimate(log.frame, urdf) for log in logs.values())])


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
