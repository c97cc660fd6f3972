"""What the model of a bench that shares no code with metaid predicts of the torque along a multisine that it has not
seen (docs/real-plants.md).

    python -m benchmarks.bench_torque --rows all --seeds 5

The study is that of `benchmarks.benches`: four trials of pushes, all by default. Then the same bench, with all that it
has but limits of the motors, which a motion to record keeps, is moved along sums of sines by a PD controller that reads
its encoders. The `.py` that metaid hands over predicts what was commanded, from the motion. So do the true rigid bodies
with true viscous and dry friction and rotors. What either leaves is a share of what was commanded, both through a
low-pass filter, over all joints.
"""

from __future__ import annotations

import argparse
import logging
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, filtfilt

from benchmarks.bench_truth import told_unit
from benchmarks.benches import ROWS, run_bench, true_links
from benchmarks.common import table, two_digits
from metaid.exporting import IdentifiedModel, file_torques
from metaid.models import Array
from metaid.results import identified_model
from soak.bench import Bench, Imperfections, arm_of_links
from soak.bench.dynamics import equations, room

TIMESTEP, SECONDS, CUTOFF = 0.002, 30.0, 10.0  # s, s, Hz
SINES = ((0.13, 0.7), (0.31, 0.5), (0.53, 0.35), (0.97, 0.2), (1.7, 0.08))  # Hz and rad
STIFFNESS, DAMPING = 20.0, 0.5  # N m/rad and N m s/rad, of the controller


def multisine(has: dict[str, Any], links: int, seed: int) -> tuple[Array, Array, Array, Array]:
    """Coordinates, speeds and accelerations of a bench along a multisine, and the torques that were commanded (nstep x
    njoint each), of the middle of each tick.
    """
    bench = Bench(
        arm_of_links({"links": true_links(links)}), TIMESTEP, Imperfections(**has, seed=seed + 100), is_planar=True
    )
    bench.push([0.0] * links)
    random, count = np.random.default_rng([6, seed]), round(SECONDS / TIMESTEP)
    phases = random.uniform(0.0, 2.0 * np.pi, (len(SINES), links))
    states, times, torques = np.zeros((count + 1, 2, links)), np.zeros(count + 1), np.zeros((count, links))
    for step in range(count):
        states[step], times[step] = bench.state[:2], bench.time
        angles, speeds = map(np.array, bench.states())
        turned = 2.0 * np.pi * np.array([hertz for hertz, _ in SINES])
        size, begun = np.array([size for _, size in SINES]), min(bench.time / 2.0, 1.0)
        wanted = begun * size @ np.sin(turned[:, None] * bench.time + phases)
        moving = begun * (size * turned) @ np.cos(turned[:, None] * bench.time + phases)
        torques[step] = STIFFNESS * (wanted - angles) + DAMPING * (moving - speeds)
        bench.advance(torques[step].tolist())
    states[count], times[count] = bench.state[:2], bench.time
    middle, gone = 0.5 * (states[1:] + states[:-1]), np.diff(times)[:, None]
    return middle[:, 0], middle[:, 1], np.diff(states[:, 1], axis=0) / gone, torques


def true_torque(has: dict[str, Any], links: int, angles: Array, speeds: Array, accelerations: Array) -> Array:
    """What the rigid bodies of a bench need with viscous and dry friction and rotors (nstep x njoint), by its own
    equations, in units of what its first motor is told.
    """
    given, of_bench = Imperfections(**has), arm_of_links({"links": true_links(links)})
    arm = of_bench._replace(rotors=of_bench.rotors + given.each("rotors", links))
    friction, work = given.each("viscous", links) * speeds + given.each("dry", links) * np.sign(speeds), room(links)
    needed = np.zeros_like(angles)
    for step, (angle, speed, acceleration) in enumerate(zip(angles, speeds, accelerations, strict=True)):
        equations(arm, angle, speed, work)
        needed[step] = work.mass @ acceleration + work.bias
    return (needed + friction) / told_unit(has)


def handed_over(model: IdentifiedModel, motion: tuple[Array, Array, Array]) -> Array:
    """What the `.py` of a model predicts (nstep x njoint), in N m, loaded again."""
    joints = [f"joint_{joint + 1}" for joint in range(model.njoint)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "model.py")
        model.write(path)
        torques = file_torques(path, "model", *motion, joints).torques
    assert torques is not None
    return torques


def left(commanded: Array, predicted: Array) -> float:
    """What a prediction leaves, as a share of what was commanded."""
    sections = butter(3, 2.0 * CUTOFF * TIMESTEP)
    rows = slice(round(2.0 / TIMESTEP), -round(0.5 / TIMESTEP))
    sent, told = (filtfilt(*sections, each, axis=0)[rows] for each in (commanded, predicted))
    return float(np.sqrt(((sent - told) ** 2).sum() / (sent**2).sum()))


def main() -> None:
    """Runs what is asked for and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", nargs="+", default=["all"], choices=list(ROWS), metavar="ROW")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--links", type=int, default=2)
    given = parser.parse_args()
    logging.disable(logging.WARNING)
    shown = []
    for row in given.rows:
        for seed in range(given.seeds):
            has = {name: value for name, value in ROWS[row][1].items() if name != "torque_limit"}
            snapshot, _ = run_bench(row, str(given.links), TIMESTEP, seed)
            model = identified_model(snapshot)
            angles, speeds, accelerations, commanded = multisine(has, given.links, seed)
            motion = angles, speeds, accelerations
            handed = left(commanded, handed_over(model, motion))
            true = left(commanded, true_torque(has, given.links, *motion))
            shown.append(
                {
                    "the bench has": ROWS[row][0],
                    "seed": str(seed),
                    "verdict": model.about["verdict"],
                    "metaid's .py leaves": f"{two_digits(100.0 * handed)} %",
                    "true bodies, friction and rotors leave": f"{two_digits(100.0 * true)} %",
                    "ratio": f"{handed / true:.2f}",
                }
            )
    print(table(shown))


if __name__ == "__main__":
    main()
