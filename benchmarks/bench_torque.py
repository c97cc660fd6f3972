"""What the model of a bench that shares no code with metaid predicts of the torque along a multisine that it has not
seen (docs/real-plants.md).

    python -m benchmarks.bench_torque --rows all --robots 2 3 5 arm --timestep 0.002 0.001 --seeds 5

The study is that of `benchmarks.benches`: four trials of pushes, all by default. Then the same bench, with all that it
has but limits of the motors, which a motion to record keeps, is moved along sums of sines by a PD controller that reads
its encoders. The `.py` that metaid hands over predicts what was commanded, from the motion. So do the true rigid bodies
with true viscous and dry friction and rotors. What either leaves is a share of what was commanded, both through a
low-pass filter, over all joints. Chains are moved about where they hang, which no push has shown; the controller is as
stiff as the delay, the lag and the filter of its speeds allow.
"""

from __future__ import annotations

import argparse
import logging
import tempfile
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, filtfilt

from benchmarks.bench_truth import told_unit, true_arm
from benchmarks.benches import ARM, ARM_FILE, HOME, ROWS, imperfections_of, run_bench, true_links
from benchmarks.common import table, two_digits
from metaid.exporting import IdentifiedModel, file_torques
from metaid.models import Array
from metaid.results import identified_model
from soak.bench import Arm, Bench, Imperfections, arm_of_links, arm_of_mjcf
from soak.bench.dynamics import equations, room

SECONDS, CUTOFF = 30.0, 10.0  # s, Hz
SINES = ((0.13, 0.7), (0.31, 0.5), (0.53, 0.35), (0.97, 0.2), (1.7, 0.08))  # Hz and rad
FASTEST, STIFFNESS = 40.0, 40.0  # 1/s: of the modes of what is controlled; of the controller, N m/rad to N m s/rad


def body_of(robot: str) -> Arm:
    """The links of a bench, of a chain of so many, or of the "arm"."""
    return arm_of_mjcf(ARM_FILE) if robot == ARM else arm_of_links({"links": true_links(int(robot))})


def multisine(has: dict[str, Any], robot: str, timestep: float, seed: int) -> tuple[Array, Array, Array, Array]:
    """Coordinates, speeds and accelerations of a bench along a multisine, and the torques that were commanded (nstep x
    njoint each), of the middle of each tick.

    Args:
        has: the imperfections of the bench.
        robot: a number of links, or "arm".
        timestep: of a tick, in s.
        seed: of the phases of the sines, and of the chance of the bench.
    """
    bench = Bench(body_of(robot), timestep, Imperfections(**has, seed=seed + 100), is_planar=robot != ARM)
    home = np.array(HOME) if robot == ARM else np.pi * np.eye(int(robot))[0]
    bench.push(*[[0.0] * len(home) for _ in bench.needs])
    bench.state[0] = home
    damping = FASTEST / np.linalg.eigvalsh(np.linalg.inv(_mass(bench.arm, home))).max()
    random, count = np.random.default_rng([6, seed]), round(SECONDS / timestep)
    phases = random.uniform(0.0, 2.0 * np.pi, (len(SINES), len(home)))
    states, times, torques = np.zeros((count + 1, 2, len(home))), np.zeros(count + 1), np.zeros((count, len(home)))
    for step in range(count):
        states[step], times[step] = bench.state[:2], bench.time
        angles, speeds = map(np.array, bench.states())
        turned = 2.0 * np.pi * np.array([hertz for hertz, _ in SINES])
        size, begun = np.array([size for _, size in SINES]), min(bench.time / 2.0, 1.0)
        wanted = home + begun * size @ np.sin(turned[:, None] * bench.time + phases)
        moving = begun * (size * turned) @ np.cos(turned[:, None] * bench.time + phases)
        torques[step] = damping * (STIFFNESS * (wanted - angles) + moving - speeds)
        bench.advance(torques[step].tolist())
    states[count], times[count] = bench.state[:2], bench.time
    middle, gone = 0.5 * (states[1:] + states[:-1]), np.diff(times)[:, None]
    return middle[:, 0], middle[:, 1], np.diff(states[:, 1], axis=0) / gone, torques


def _mass(arm: Arm, angles: Array) -> Array:
    work = room(len(angles))
    equations(arm, angles, np.zeros(len(angles)), work)
    return np.asarray(work.mass, dtype=np.float64)


def true_torque(has: dict[str, Any], robot: str, angles: Array, speeds: Array, accelerations: Array) -> Array:
    """What the rigid bodies of a bench need with viscous and dry friction and rotors (nstep x njoint), by its own
    equations, in units of what its first motor is told.
    """
    given, bodies, joints = Imperfections(**has), body_of(robot), angles.shape[1]
    arm = bodies._replace(rotors=bodies.rotors + given.each("rotors", joints))
    friction, work = given.each("viscous", joints) * speeds + given.each("dry", joints) * np.sign(speeds), room(joints)
    needed = np.zeros_like(angles)
    for step, (angle, speed, acceleration) in enumerate(zip(angles, speeds, accelerations, strict=True)):
        equations(arm, angle, speed, work)
        needed[step] = work.mass @ acceleration + work.bias
    return (needed + friction) / told_unit(has)


def handed_over(model: IdentifiedModel, motion: tuple[Array, Array, Array], joints: Sequence[str]) -> Array:
    """What the `.py` of a model of these `joints` predicts (nstep x njoint), in N m, loaded again."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "model.py")
        model.write(path)
        torques = file_torques(path, "model", *motion, joints).torques
    assert torques is not None
    return torques


def left(commanded: Array, predicted: Array, timestep: float) -> float:
    """What a prediction leaves, as a share of what was commanded."""
    sections = butter(3, 2.0 * CUTOFF * timestep)
    rows = slice(round(2.0 / timestep), -round(0.5 / timestep))
    sent, told = (filtfilt(*sections, each, axis=0)[rows] for each in (commanded, predicted))
    return float(np.sqrt(((sent - told) ** 2).sum() / (sent**2).sum()))


def try_torque(row: str, robot: str, timestep: float, seed: int) -> dict[str, str]:
    """Runs one study, and predicts what it has not seen: a row of the table."""
    has = {name: value for name, value in imperfections_of(row, robot).items() if name != "torque_limit"}
    snapshot, _ = run_bench(row, robot, timestep, seed)
    model = identified_model(snapshot)
    *motion, commanded = multisine(has, robot, timestep, seed)
    angles, speeds, accelerations = motion
    joints = true_arm(ARM_FILE, {}).names if robot == ARM else [f"joint_{joint + 1}" for joint in range(model.njoint)]
    handed = left(commanded, handed_over(model, (angles, speeds, accelerations), joints), timestep)
    true = left(commanded, true_torque(has, robot, angles, speeds, accelerations), timestep)
    return {
        "the bench has": ROWS[row][0],
        "robot": robot,
        "ticks in a second": f"{1.0 / timestep:.0f}",
        "seed": str(seed),
        "verdict": model.about["verdict"],
        "metaid's .py leaves": f"{two_digits(100.0 * handed)} %",
        "true bodies, friction and rotors leave": f"{two_digits(100.0 * true)} %",
        "ratio": f"{handed / true:.2f}",
    }


def main() -> None:
    """Runs what is asked for and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", nargs="+", default=["all"], choices=list(ROWS), metavar="ROW")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--robots", nargs="+", default=["2"], metavar="LINKS", help=f"a number of links, or '{ARM}'")
    parser.add_argument("--timestep", type=float, nargs="+", default=[0.002])
    given = parser.parse_args()
    logging.disable(logging.WARNING)
    asked = product(given.rows, given.robots, given.timestep, range(given.seeds))
    print(table([try_torque(*each) for each in asked]))


if __name__ == "__main__":
    main()
