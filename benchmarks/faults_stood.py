"""Which faults of a plant an estimate stands: those that it knows, those that nobody told it, those that it finds.

    python -m benchmarks.faults_stood
    python -m benchmarks.faults_stood --faults "a base tilted by 30 mrad" --chains 10

Chains of three links (`benchmarks/chains.py`), nominal models that are wrong by 30 %, `output-error`, four trials of
six pushes, 1 mrad on the angles and no speed sensor, and beside that one fault at a time. Each is simulated, and is on
the bench that shares no code with metaid (`soak.bench`). Once lumps alone are searched, and once `faults = "proposed"`,
where faults that explain what was seen are searched. Medians of the worst lump, how many of the studies are `found`,
and what was taken up; seconds are those of computing.
"""

from __future__ import annotations

import argparse
import json
import logging
import time
from collections import Counter
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.bench_truth import true_lumps
from benchmarks.chain_on_bench import made_on_bench
from benchmarks.chain_study import chain_study
from benchmarks.chains import random_chain
from benchmarks.common import made, resumed, table, two_digits
from metaid.plant import PlantSettings, chain_of
from metaid.results import read_snapshot
from metaid.study import run_study

LINKS, TRIALS = 3, 4
NOISE = {"angle_noise": 1e-3, "speed_sensor": False}
HALF_A_DEGREE = float(np.deg2rad(0.5))
# What it is called, what a plant file has, and what each link has.
FAULTS: dict[str, tuple[dict[str, Any], dict[str, float]]] = {
    "nothing else": ({}, {}),
    "10 mrad on the angles": ({"angle_noise": 0.01}, {}),
    "encoder steps of 3 mrad": ({"encoder_step": 0.003}, {}),
    "encoder steps of 30 mrad": ({"encoder_step": 0.03}, {}),
    "pushes that differ by 2 %": ({"push_noise": 0.02}, {}),
    "pushes that differ by 10 %": ({"push_noise": 0.1}, {}),
    "a new torque every 8 ms": ({"control_every": 4}, {}),
    "torques 8 ms late": ({"delay": 4}, {}),
    "0.03 N m of torque noise": ({"torque_noise": 0.03}, {}),
    "0.3 N m of torque noise": ({"torque_noise": 0.3}, {}),
    "torques of at most 8 N m": ({"torque_limit": 8.0}, {}),
    "the same, and the study says so": ({"torque_limit": 8.0}, {}),
    "a base tilted by 3 mrad": ({"tilt": 0.003}, {}),
    "a base tilted by 30 mrad": ({"tilt": 0.03}, {}),
    "encoders that read 0.5° too much": ({"encoder_offset": HALF_A_DEGREE}, {}),
    "motors that give 0, 5 and −7 % more": ({"torque_gain": (1.0, 1.05, 0.93)}, {}),
    "viscous friction of 0.02 N m s": ({}, {"damping": 0.02}),
    "dry friction of 0.02 N m": ({}, {"frictionloss": 0.02}),
    "springs of 0.3 N m/rad": ({}, {"stiffness": 0.3}),
}
SETTINGS: dict[str, dict[str, Any]] = {"alone": {"faults": []}, "proposed": {"faults": "proposed"}}
PLANTS = {"simulated": made, "bench": made_on_bench}
SAID = {"the same, and the study says so": {"torque_limit": 8.0}}  # in `[estimate]`


@dataclass(frozen=True)
class Stood:
    """One study: the relative error of its worst lump, given or not; whether it is `found`; the faults that it took up;
    seconds of motion and of computing.
    """

    sampler: str  # the fault, the plant and the setting, as a file of results knows it
    links: int
    seed: int
    error: float
    found: bool
    taken_up: list[str]
    motion: float
    cpu: float


def stand(named: str, nlink: int, seed: int) -> Stood:
    """Runs the study of one chain."""
    fault, plant, setting = named.split(" / ")
    faults, every_link = FAULTS[fault]
    spec = chain_study(
        random_chain(nlink, seed), TRIALS, seed, NOISE | faults, every_link, SETTINGS[setting] | SAID.get(fault, {})
    )
    assert isinstance(spec.plant, PlantSettings)
    began = time.process_time()
    with PLANTS[plant](spec) as (store, name):
        run_study(store, name, workers=1)
        snapshot = read_snapshot(store, name)
        verdict, found = snapshot.verdict, snapshot.estimate
        trials = store.trials(name, spec.names)
    cpu, error, taken_up = time.process_time() - began, np.inf, list[str]()
    if found is not None:
        identified = verdict.lumps["identified"].to_numpy()
        truth = true_lumps(chain_of(spec.plant.links), list(verdict.lumps["name"]), {})
        error = float(np.abs(identified / truth - 1.0).max())
        taken_up = list(found.estimate.faults.searched.kinds) if found.estimate.faults else []
    motion = sum(trial.outcome.steps for trial in trials) * spec.timestep
    return Stood(named, nlink, seed, error, verdict.is_found, taken_up, motion, cpu)


def rows_of(stood: list[Stood]) -> list[dict[str, Any]]:
    """The rows of the table."""
    rows = []
    for fault in FAULTS:
        row: dict[str, Any] = {"what the plant has": fault}
        for plant, setting in product(PLANTS, SETTINGS):
            own = [each for each in stood if each.sampler == f"{fault} / {plant} / {setting}"]
            if own:
                row[f"{plant}, {setting}"] = f"{two_digits(100.0 * median(each.error for each in own))} %"
                row[f"found, {plant}, {setting}"] = f"{sum(each.found for each in own)} of {len(own)}"
                if setting == "proposed":
                    kinds = Counter(kind for each in own for kind in each.taken_up)
                    told = ", ".join(f"{kind} {count}" for kind, count in kinds.most_common())
                    row[f"taken up, {plant}"] = told or None
                row[f"seconds, {plant}, {setting}"] = round(median(each.cpu for each in own), 1)
        if len(row) > 1:
            rows.append(row)
    return rows


def describe(stood: Stood) -> str:
    """A study for the line of progress."""
    return f"{stood.error:.2%} {stood.taken_up} {stood.cpu:.1f} s"


def main() -> None:
    """Runs what is asked for and prints the table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--faults", nargs="+", choices=list(FAULTS), default=list(FAULTS))
    parser.add_argument("--plants", nargs="+", choices=list(PLANTS), default=list(PLANTS))
    parser.add_argument("--chains", type=int, default=3)
    parser.add_argument("--results", type=Path, help="a file of finished studies, which are not run again")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    wanted = [
        (f"{fault} / {plant} / {setting}", LINKS, seed)
        for seed, fault, plant, setting in product(range(given.chains), given.faults, given.plants, SETTINGS)
    ]
    logging.disable()
    with threadpool_limits(1):
        rows = resumed(Stood, wanted, stand, describe, given.results)
    print(json.dumps([asdict(row) for row in rows], indent=2) if given.json else table(rows_of(rows)))


if __name__ == "__main__":
    main()
