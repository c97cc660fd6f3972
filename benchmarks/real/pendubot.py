"""A pendubot, whose second joint has no motor: swing-ups, falls and balancing of 2022 and 2025, each from the other.

A log is a laboratory's text as it is: a preamble that is no UTF-8, decimal commas, a count of rows in place of times,
and 50 readings a second that a host has written in 3 or 6 rows each, sometimes in two parts. Both angles are against
gravity and 0 where a link hangs, the motor's voltage stands for its torque. The laboratory's model has no friction.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

import metaid
from benchmarks.real.double_pendulum import AHEAD, CUTOFFS, Simulate, by_equations, by_mujoco
from benchmarks.real.judging import Log, motion_of
from benchmarks.real.least_squares import tuned
from benchmarks.real.lines import Line, Table
from benchmarks.real.pendulum import of_values
from metaid.models import Array
from metaid.plant import load_chain
from metaid.recorded import RecordedResult, chain_model

REPOSITORY = "pendubot_controller"  # of Capitan-Uncino, at 399ba17
YEARS = {"2022": ("Test_1.txt",), "2025": ("TEST_C1_V1.txt", "TEST_C1_V2.txt", "TEST_C2.txt")}
ANGLES, PERIOD, USUAL = 20.0, 0.02, 5  # Hz of the filter of the first states; s; rows of a reading
VOLT = 3.9621 / 8.0  # N m, as the laboratory says
LAB = {  # its p1 to p5, in kg m² and kg m
    **{"gravity_1": 0.1003, "gravity_2": 0.0303, "coriolis_1_2": 0.0046},
    **{"inertia_1": 0.0148, "inertia_2": 0.0051, "rotor_2": 0.0},
}
NOMINAL = "[[links]]\nlength = 0.15\nmass = 0.5\ncom = 0.1\n[[links]]\nlength = 0.25\nmass = 0.2\ncom = 0.12\n"
MOVES = 1.5  # rad/s: states in which some joint is faster are judged
STILL = 0.02  # rad/s, below which dry friction is a share of its whole
NAMED = {"--zero all=3.1416", "--absolute 2"}
MOST_BESIDE = 1.0


def read_log(path: Path) -> Log:
    """A log of the laboratory, a row a reading, in joint angles that are 0 upright, and in N m."""
    lines = path.read_text(encoding="latin-1").replace(",", ".").splitlines()
    rows = np.array([line.split() for line in lines[3:] if len(line.split()) == 8], dtype=float)
    begins = np.flatnonzero(np.diff(rows[:, 1:], axis=0, prepend=np.nan).any(axis=1))
    lasts = np.diff(begins, append=len(rows))
    torn = np.flatnonzero((lasts[:-1] < USUAL // 2 + 1) & (lasts[:-1] + lasts[1:] <= USUAL + 2)) + 1
    whole = np.delete(begins, torn)
    ends = np.append(whole[1:], len(rows)) - 1
    first, second = rows[whole, 3], rows[whole, 5]
    angles = np.stack([first + np.pi, second - first], axis=1)
    torques = np.stack([VOLT * rows[ends, 1], np.zeros(len(whole))], axis=1)
    return Log(path.stem, PERIOD * np.arange(len(whole), dtype=np.float64), angles, torques)


def missed(log: Log, simulate: Simulate) -> Array:
    """By how far simulations miss the angles (nstart x njoint), in rad, from states in which a joint moves."""
    motion, ahead = motion_of(log, ANGLES), round(AHEAD / PERIOD)
    rows = np.arange(ahead, len(motion.times) - 2 * ahead)
    rows = rows[(np.abs(motion.speeds[rows]) > MOVES).any(axis=1)]
    ended = simulate(motion.angles[rows], motion.speeds[rows], log, motion.times[rows])
    return np.abs(ended - motion.angles[rows + ahead])


def score(logs: list[Log], simulate: Simulate) -> Array:
    """The median of both joints (2), in mrad, over all states of some logs: falls are of a chaotic motion."""
    return np.asarray(1e3 * np.median(np.concatenate([missed(log, simulate) for log in logs]), axis=0))


def tuned_best(nominal: Path, learned: list[Log], predicted: list[Log]) -> tuple[str, Array]:
    """The least squares that are best on the logs that are predicted: their name and score."""
    plant = load_chain(nominal)
    model = chain_model(plant.chain, plant.gravity).with_friction(("viscous", "coulomb")).with_still(np.full(2, STILL))
    found = {}
    for name, values in tuned(model, learned, CUTOFFS):
        pendulum = of_values(dict(zip(model.names, values.tolist(), strict=True)))
        found[f"least squares, {name}"] = score(predicted, by_equations(pendulum))
    return min(found.items(), key=lambda each: float(np.linalg.norm(each[1])))


def estimated(paths: list[Path], nominal: Path, zero: float, absolute: tuple[str, ...]) -> RecordedResult:
    """What metaid says of logs as they are: beside what these do not say, a count of 250 rows a second and volts."""
    columns, scale = {"U": "torque_1", "Alpha": "angle:rad"}, {"1": VOLT}
    return metaid.estimate(
        paths, nominal, columns=columns, rate=250.0, scale=scale, zero={"all": zero}, absolute=absolute
    )


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    nominal, own = place / "nominal.toml", place / "own.xml"
    nominal.write_text(NOMINAL, encoding="utf-8")
    paths = {year: [folder / "Data_Exp" / name for name in names] for year, names in YEARS.items()}
    logs = {year: [read_log(path) for path in every] for year, every in paths.items()}
    for learned, predicted in (("2022", "2025"), ("2025", "2022")):
        result = estimated(paths[learned], nominal, np.pi, ("2",))
        result.model.write(own)
        name, best = tuned_best(nominal, logs[learned], logs[predicted])
        scores = {
            "metaid, .xml": score(logs[predicted], by_mujoco(own)),
            "the laboratory's": score(logs[predicted], by_equations(of_values(LAB))),
            name: best,
        }
        yield Table(
            f"pendubot, from {learned} to {predicted}, median mrad after {AHEAD} s: {result.verdict.word}",
            [{"model": model, "1": f"{one:.0f}", "2": f"{two:.0f}"} for model, (one, two) in scores.items()],
        )
        ours, *others = (float(np.linalg.norm(each)) for each in scores.values())
        yield Line(f"pendubot, {predicted}: both joints beside the best of the others", ours / min(others), MOST_BESIDE)
    named = {str(option) for option in estimated(paths["2025"][:1], nominal, 0.0, ()).facts[0].options}
    yield Line("pendubot: how its angles are measured is named", float(named == NAMED), 1.0, at_least=True)
