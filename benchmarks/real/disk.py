"""An unbalanced disk on the shaft of a motor: from half of a log of 15 minutes to what follows, simulated in one go.

The log has a motor's voltage and an angle, 40 times a second, and no times. Its authors simulate a log that is not
published: a network of theirs misses 27 mrad there, a linear model 255, and the best that can be 20. Beside metaid's
files stand the parameters of their simulator, and tuned least squares, each with the delay that suits it best: metaid
has its own from what it learns.
"""

from __future__ import annotations

import runpy
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import mujoco
import numpy as np

import metaid
from benchmarks.real.double_pendulum import CUTOFFS
from benchmarks.real.judging import LAW_STEP, Log, course, law_course, motion_of
from benchmarks.real.least_squares import tuned
from benchmarks.real.lines import Line, Table
from benchmarks.real.printed import printed_and_measured, printed_line
from benchmarks.real.simple_pendulum import HEAVY, bar
from metaid.models import Array
from metaid.plant import load_chain
from metaid.recorded import chain_model

REPOSITORY = "gym-unbalanced-disk"  # of GerbenBeintema
LOG = "disc-benchmark-files/training-val-test-data.npz"
RATE, ANGLES = 40.0, 19.0  # Hz: of rows, and of the filter that the first state passes
NOMINAL = "[[links]]\nlength = 0.1\nmass = 0.07\ncom = 0.04\n"  # a small weight on a disk
SIMULATOR = {"gravity": 11.339846957**2 / 9.81, "inertia": 1.0, "damping": 1.3328339309, "coulomb": 6.0627295094}
VOLT = 28.1361584072  # rad/s² that a volt of theirs makes
ASKED = 100.0  # s
DELAYS = (0.0, 0.5, 1.0)  # periods
MOST, MOST_BESIDE = 60.0, 1.0  # mrad, and of the best of the others


def missed(log: Log, angles: Array) -> float:
    """Root mean square of simulated `angles` (nrow - 1), in mrad, from the second row on."""
    return float(1e3 * np.sqrt(np.mean((angles - log.angles[1:, 0]) ** 2)))


def late(log: Log, delay: float) -> Log:
    """The log whose torques act `delay` s later."""
    return replace(log, times=log.times + delay)


def by_mujoco(path: Path, log: Log, delay: float) -> float:
    """The error of a simulation of the whole log, in mrad."""
    model, first = mujoco.MjModel.from_xml_path(str(path)), motion_of(log, ANGLES)
    model.opt.timestep = 1e-3
    every = round(1.0 / RATE / model.opt.timestep)
    seconds = (len(log.times) - 1) / RATE
    state = first.angles[:1], first.speeds[:1]
    angles, _ = course(model, *state, late(log, delay), log.times[:1], seconds)
    return missed(log, angles[0, every - 1 :: every, 0])


def by_law(path: Path, log: Log, delay: float) -> float:
    """The same by the law in Python."""
    every = round(1.0 / RATE / LAW_STEP)
    count = (len(log.times) - 1) * every
    steps = law_course(runpy.run_path(str(path)), motion_of(log, ANGLES), 0, late(log, delay), count)
    return missed(log, np.array([q[0] for q, _ in islice(steps, every - 1, None, every)]))


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    data = np.load(folder / LOG)
    whole = Log("disk", np.arange(len(data["th"])) / RATE, np.pi + data["th"][:, None], data["u"][:, None])
    half = len(whole.times) // 2
    learned, asked = whole.rows(slice(half)), whole.rows(slice(half, half + round(ASKED * RATE)))
    nominal, files = place / "nominal_disk.toml", [place / "disk.py", place / "disk.xml"]
    nominal.write_text(NOMINAL, encoding="utf-8")
    result = metaid.estimate(learned.write(place), nominal)
    for path in files:
        result.model.write(path)
    delay, zeros = result.summary["delay"], result.summary["logs"][0]["zeros"]
    seen = replace(asked, angles=asked.angles + zeros)
    found = {"metaid, .py": by_law(files[0], seen, delay), "metaid, .xml": by_mujoco(files[1], seen, delay)}
    found |= dict(rivals(learned, asked, nominal, place))
    ours, best = found["metaid, .py"], min(error for name, error in found.items() if not name.startswith("metaid"))
    rows = [{"model": name, "mrad": f"{error:.1f}"} for name, error in found.items()]
    yield Table(f"unbalanced disk, the next 100 s simulated in one go: {result.verdict.word}", rows)
    printed = [printed_and_measured(result, path, [learned]) for path in files]
    yield Table("unbalanced disk, errors that are printed", printed)
    yield printed_line("unbalanced disk", printed)
    yield Line("unbalanced disk: mrad of the next 100 s in one go", ours, MOST)
    yield Line("unbalanced disk: beside the best of the others", ours / best, MOST_BESIDE)


def rivals(learned: Log, asked: Log, nominal: Path, place: Path) -> Iterator[tuple[str, float]]:
    """Errors of the authors' simulator, and of the least squares that are best on what is `asked`, in mrad."""
    volts = {name: value / VOLT for name, value in SIMULATOR.items()}
    authors = bar(place, "authors", volts)
    yield "its authors' simulator", min(by_mujoco(authors, asked, periods / RATE) for periods in DELAYS)
    plant = load_chain(nominal)
    model = chain_model(plant.chain, plant.gravity).with_still(np.full(1, 0.02))
    errors = {}
    for periods in (0, 1):
        shifted = replace(learned, torques=np.roll(learned.torques, periods, axis=0)).rows(slice(periods, None))
        for name, values in tuned(model, [shifted], CUTOFFS):
            unknowns = dict(zip(("gravity", "inertia", "damping", "coulomb"), values.tolist(), strict=True))
            if unknowns["inertia"] > unknowns["gravity"] ** 2 / HEAVY:
                path = bar(place, "rival_disk", unknowns)
                errors[f"least squares, {name}, {periods} late"] = by_mujoco(path, asked, periods / RATE)
    yield min(errors.items(), key=lambda each: each[1])
