"""What a push study says of a bench that shares no code with metaid, whatever the bench has (docs/real-plants.md).

    python -m benchmarks.benches
    python -m benchmarks.benches --rows delay friction --seeds 1 --robots 2 arm --timestep 0.002

The bench is `soak.bench`: own equations, Runge-Kutta steps at 20 kHz, behind the socket, with the numbers of a double
pendulum of a laboratory: encoder steps of 0.38 mrad. Each row has one imperfection, the last all of them. The nominal
model is wrong by up to 25 % in each mass, length, centre of mass and inertia; that of the arm, `spatial-three-link`, is
drawn by its study. All else is by default. The table has, over all seeds, the verdicts, the worst error (of a lump; of
an arm that of gravity's, Coriolis' and inertia's torques at random states), how many of the 95 % intervals hold the
truth, and seconds.
"""

from __future__ import annotations

import argparse
import json
import logging
import shutil
import tempfile
import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.bench_truth import told_unit, true_arm, true_base, true_chain, true_lumps
from benchmarks.common import table as markdown
from benchmarks.common import two_digits
from metaid.estimation import ArmEstimate
from metaid.models import Array
from metaid.models.tree import model_error
from metaid.results import Snapshot, read_snapshot
from metaid.store import Store
from metaid.study import create_study, load_study, run_study
from metaid.study.estimates import StudyEstimate
from soak.bench.serving import ROOT, bench

ARM, ARM_FILE = "arm", ROOT / "plants" / "arms" / "spatial-three-link.xml"
HOME = (0.0, 0.5, 1.0)  # rad, of the arm
Each = tuple[float, ...]
Told = tuple[Array, float]  # the true lumps or base parameters, and the worst error of what was found

ENCODER: dict[str, Any] = {"encoder_step": 0.38e-3}
TRUE = ((0.30, 0.60, 0.21, 0.0062), (0.20, 0.55, 0.15, 0.0035))  # length, mass, centre of mass, inertia
WRONG = 0.25  # of each of them, at most
TRIALS = 4
# Of two joints; those of further joints have none.
ROWS: dict[str, tuple[str, Mapping[str, Any]]] = {
    "exact": ("nothing wrong, exact encoders", {}),
    "encoders": ("encoder steps of 0.38 mrad", ENCODER),
    "filter": ("and a speed filter of 5 ms", ENCODER | {"speed_filter": 0.005}),
    "viscous": ("viscous friction, 0.02 and 0.01 N m s", ENCODER | {"viscous": (0.02, 0.01)}),
    "gains": ("gains of +5 and −5 %", ENCODER | {"gains": (0.05, -0.05)}),
    "delay": ("a delay of 3 ms that jitters by 10 %", ENCODER | {"delay": 0.003, "delay_jitter": 0.1}),
    "lag": ("a torque lag of 3 ms", ENCODER | {"torque_lag": 0.003}),
    "ticks": ("ticks that jitter by 0.1 ms, and time stamps", ENCODER | {"tick_jitter": 1e-4, "tells_time": 1.0}),
    "limits": ("torques cut off at 2 and 0.5 N m", ENCODER | {"torque_limit": (2.0, 0.5)}),
    "rotors": ("rotors, 0.0057 kg m² each", ENCODER | {"rotors": (0.0057, 0.0057)}),
    "friction": ("dry friction with stiction, 0.16 and 0.12 N m", ENCODER | {"dry": (0.16, 0.12)}),
    "tenth": ("a tenth of it", ENCODER | {"dry": (0.016, 0.012)}),
    "cogging": ("cogging of 0.03 N m", ENCODER | {"cogging": (0.03, 0.03)}),
    "cable": ("a cable of 0.05 N m/rad", ENCODER | {"cable": (0.05, 0.05)}),
    "tilt": ("a tilt of 10 mrad", ENCODER | {"tilt": 0.01}),
    "starts": ("start angles that scatter by 2 mrad", ENCODER | {"start_angles": 0.002}),
    "speeds": ("start speeds that scatter by 2 %", ENCODER | {"start_speeds": 0.02}),
    "three": (
        "delay, tilt and viscous friction together",
        ENCODER | {"delay": 0.003, "tilt": 0.01, "viscous": (0.02, 0.01)},
    ),
}
OF_ARM: Mapping[str, Any] = {"torque_limit": (2.0, 7.0)}  # what a pendulum's shoulder gives, no arm stands with
EVERYTHING = {key: value for _, has in ROWS.values() for key, value in has.items()} | {"dry": (0.16, 0.12)}
ROWS["all"] = ("all of it, as a real bench has", EVERYTHING)
ROWS["rough"] = ("noise of 0.1 N m on every torque", ENCODER | {"torque_noise": 0.1})


@dataclass(frozen=True)
class Judged:
    """What became of one study: its `verdict`, the `misfit`, the `worst` error, how many intervals of how many lumps
    or base parameters hold the truth, and what was `taken_up`.
    """

    row: str
    robot: str
    seed: int
    verdict: str
    misfit: float
    worst: float
    held: int
    lumps: int
    seconds: float
    taken_up: str


def imperfections_of(row: str, robot: str) -> dict[str, Any]:
    """What the bench of a `row` has, of a `robot`: torques are cut off at what suits an arm, and where more links hang
    on the joints at the same share of what holds them level.
    """
    has = dict(ROWS[row][1])
    if robot == ARM:
        return has | {key: value for key, value in OF_ARM.items() if key in has}
    if "torque_limit" in has:
        shares = level_torques(int(robot))[:2] / level_torques(2)
        has["torque_limit"] = tuple((np.array(has["torque_limit"]) * shares).tolist())
    return has


def level_torques(links: int) -> Array:
    """What holds so many links level in the first two joints (2), in N m."""
    length, mass, com, _ = np.array([list(link.values()) for link in true_links(links)]).T
    places = np.cumsum(length) - length
    weights = [mass[joint:] @ (places[joint:] + com[joint:] - places[joint]) for joint in range(2)]
    return 9.81 * np.array(weights)


def true_links(links: int) -> list[dict[str, float]]:
    """The links of a bench of so many: those of two again and again."""
    keys = "length", "mass", "com", "inertia"
    return [dict(zip(keys, TRUE[link % len(TRUE)], strict=True)) for link in range(links)]


def _toml(key: str, links: list[dict[str, float]]) -> str:
    each = ("\n".join(f"{name} = {value!r}" for name, value in link.items()) for link in links)
    return "".join(f"[[{key}]]\n{text}\n" for text in each)


def write_study(folder: Path, address: str, robot: str, timestep: float, seed: int, settings: str = "") -> Path:
    """The study file of a rig at an `address`, with a nominal model that is wrong, in a `folder` with its plant."""
    joints = 3 if robot == ARM else int(robot)
    rig = f'socket = "{address}"\njoints = {joints}\ntimestep = {timestep}\nstep_timeout = 60.0\n'
    (folder / "rig.toml").write_text(rig)
    text = f'plant = "rig.toml"\nsampler = "output-error"\ntrials = {TRIALS}\nseed = {seed}\n{settings}\n'
    study = folder / "bench.toml"
    study.write_text(
        text + (_arm_nominal(folder, seed) if robot == ARM else _toml("nominal.links", _wrong(joints, seed)))
    )
    return study


def _arm_nominal(folder: Path, seed: int) -> str:
    _, shoulder, elbow = HOME
    (folder / "nominal.toml").write_text(f'mjcf = "arm.xml"\nhome = {{ shoulder = {shoulder}, elbow = {elbow} }}\n')
    shutil.copy(ARM_FILE, folder / "arm.xml")
    return f'[nominal]\nplant = "nominal.toml"\nseed = {seed}\n'


def _wrong(links: int, seed: int) -> list[dict[str, float]]:
    random, nominal = np.random.default_rng([5, links, seed]), []
    for link in true_links(links):
        factors = 1.0 + random.uniform(-WRONG, WRONG, len(link))
        wrong = {key: value * float(factor) for (key, value), factor in zip(link.items(), factors, strict=True)}
        nominal.append(wrong | {"com": min(wrong["com"], wrong["length"])})
    return nominal


def run_bench(row: str, robot: str, timestep: float, seed: int, settings: str = "") -> tuple[Snapshot, float]:
    """What one study on one bench has found, of a chain of so many links, or of the "arm", and in how many s."""
    imperfections = imperfections_of(row, robot) | {"seed": float(seed)}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plant = ARM_FILE if robot == ARM else folder / "bench-links.toml"
        if robot != ARM:
            plant.write_text(_toml("links", true_links(int(robot))))
        with (
            bench(plant, timestep, **imperfections) as address,
            closing(Store(f"{folder}/metaid.db", create=True)) as store,
        ):
            spec = load_study(str(write_study(folder, address, robot, timestep, seed, settings)))
            begin = time.perf_counter()
            create_study(store, spec, "bench")
            run_study(store, "bench")
            return read_snapshot(store, "bench"), time.perf_counter() - begin


def try_bench(row: str, robot: str, timestep: float, seed: int, settings: str = "") -> Judged:
    """Runs one study on one bench and judges it."""
    imperfections = imperfections_of(row, robot)
    snapshot, seconds = run_bench(row, robot, timestep, seed, settings)
    verdict, found = snapshot.verdict, snapshot.estimate
    if found is None:
        return Judged(row, robot, seed, verdict.word, np.inf, np.inf, 0, 0, seconds, "")
    lumps = verdict.lumps
    true, worst = (_of_arm if robot == ARM else _of_chain)(found, lumps, imperfections)
    held = int(((lumps["low"] <= true) & (true <= lumps["high"])).sum())
    faults = found.estimate.faults
    named = {} if faults is None else dict(zip(faults.searched.names, faults.values.round(5).tolist(), strict=True))
    return Judged(
        row, robot, seed, verdict.word, found.estimate.misfit, worst, held, len(true), seconds, json.dumps(named)
    )


def _of_chain(found: StudyEstimate, lumps: pd.DataFrame, imperfections: Mapping[str, Any]) -> Told:
    links = sum(str(name).startswith("gravity") for name in lumps["name"])
    true = true_lumps(true_chain(true_links(links), imperfections), list(lumps["name"]), imperfections)
    return true, float((lumps["identified"] / true - 1.0).abs().max())


def _of_arm(found: StudyEstimate, lumps: pd.DataFrame, imperfections: Mapping[str, Any]) -> Told:
    assert isinstance(found.estimate, ArmEstimate)
    tree, prior = true_arm(ARM_FILE, imperfections), found.estimate.searched.prior
    law = prior.parameters_at(found.estimate.values) * told_unit(imperfections)
    return true_base(tree, prior, imperfections), model_error(tree, law).largest


def table(judged: list[Judged]) -> str:
    """The results as a Markdown table."""
    shown = []
    for row, (about, _) in ROWS.items():
        own = [each for each in judged if each.row == row]
        if not own:
            continue
        words = [each.verdict for each in own]
        said = ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
        held = f"{sum(each.held for each in own)} of {sum(each.lumps for each in own)}"
        worst, misfit = max(each.worst for each in own), float(np.median([each.misfit for each in own]))
        shown.append(
            {
                "the bench has": about,
                "verdicts": said,
                "worst error": f"{two_digits(100.0 * worst)} %",
                "intervals that hold": held,
                "misfit": two_digits(misfit),
                "seconds": two_digits(float(np.median([each.seconds for each in own]))),
            }
        )
    return markdown(shown)


def main() -> None:
    """Runs what is asked for and prints the table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", nargs="+", default=list(ROWS), choices=list(ROWS), metavar="ROW")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--robots", nargs="+", default=["2"], metavar="LINKS", help=f"a number of links, or '{ARM}'")
    parser.add_argument("--timestep", type=float, nargs="+", default=[0.002])
    parser.add_argument("--settings", default="", help="further lines of the study file, before its nominal links")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    logging.disable(logging.WARNING)
    judged = []
    for row in given.rows:
        for robot in given.robots:
            for timestep in given.timestep:
                for seed in range(given.seeds):
                    each = try_bench(row, robot, timestep, seed, given.settings.replace("\\n", "\n"))
                    judged.append(each)
                    print(json.dumps(asdict(each)), flush=True) if given.json else None
    if not given.json:
        print(table(judged))


if __name__ == "__main__":
    main()
