"""Sixty hard chains: very light and very heavy tips, lengths of 10 to 1, nominal models 60 % off.

python -m benchmarks.hard_chains [--seeds 2] [--set sampler='"cmaes"' --set trials=1500 …]

A chain is found where every lump comes within 1 % of the truth in 12 trials. By default there are six kinds of
chains, of two to six links, two of each.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.chains import Links, random_chain
from metaid.files import parse_toml
from metaid.models import Array
from metaid.plant import LinkSettings, PlantSettings
from metaid.results import summary
from metaid.store import Store
from metaid.study import StudySettings, StudySpec, create_study, run_study

LINKS = 2, 3, 4, 5, 6
MOST_TRIALS = 12
KINDS = "ordinary", "heavy tip", "light tip", "lengths 10:1", "lengths 1:10", "nominal 60 % off"
TIMESTEP = 0.001  # s: a heavy tip makes a chain fast
WITHIN = 0.01


def _scaled(links: Links, masses: Array, lengths: Array) -> Links:
    """The `links` with masses and lengths times these factors (nlink each); inertias scale with both."""

    def one(link: LinkSettings, mass: float, length: float) -> LinkSettings:
        com, inertia = (link.com or 0.0) * length, (link.inertia or 0.0) * mass * length**2
        changed = {"mass": link.mass * mass, "length": link.length * length, "com": com, "inertia": inertia}
        return link.model_copy(update=changed)

    return tuple(map(one, links, masses.tolist(), lengths.tolist()))


def _worse(true: Links, nominal: Links, power: float) -> Links:
    """A nominal model whose errors of mass and inertia are raised to a `power`."""

    def one(exact: LinkSettings, believed: LinkSettings) -> LinkSettings:
        mass = exact.mass * (believed.mass / exact.mass) ** power
        inertia = (exact.inertia or 0.0) * ((believed.inertia or 0.0) / (exact.inertia or 1.0)) ** power
        return believed.model_copy(update={"mass": mass, "inertia": inertia})

    return tuple(map(one, true, nominal))


def hard_chain(kind: str, nlink: int, seed: int) -> tuple[Links, Links]:
    """The true and the nominal links of a chain of a `kind`, a key of KINDS."""
    true, nominal = random_chain(nlink, 1000 + seed)
    masses, lengths = np.ones(nlink), np.ones(nlink)
    power = 1.0
    if kind == "heavy tip":
        masses[-1] = 30.0
    elif kind == "light tip":
        masses[-1] = 0.03
    elif kind == "lengths 10:1":
        lengths = np.geomspace(2.0, 0.2, nlink)
    elif kind == "lengths 1:10":
        lengths = np.geomspace(0.2, 2.0, nlink)
    elif kind == "nominal 60 % off":
        power = 2.2
    return _scaled(true, masses, lengths), _worse(
        _scaled(true, masses, lengths), _scaled(nominal, masses, lengths), power
    )


@dataclass(frozen=True)
class Found:
    """What became of one chain: trials, the largest error of a lump, the best value in units of the resolution, s."""

    kind: str
    links: int
    seed: int
    trials: int
    error: float
    value: float
    seconds: float


def spec_of(kind: str, nlink: int, seed: int, changes: dict[str, Any]) -> StudySpec:
    """The study of a hard chain, with default settings but for `changes` by dotted key."""
    true, nominal = hard_chain(kind, nlink, seed)
    tables: dict[str, Any] = {"plant": "chain", "nominal": "nominal", "trials": MOST_TRIALS, "seed": seed}
    for key, value in changes.items():
        *parents, last = key.split(".")
        table = tables
        for parent in parents:
            table = table.setdefault(parent, {})
        table[last] = value
    plant = PlantSettings(links=true, timestep=TIMESTEP)
    study = StudySettings.model_validate(tables)
    return StudySpec(name="chain", plant_name="chain", plant=plant, nominal=nominal, study=study)


def find(spec: StudySpec) -> tuple[int, float, float]:
    """Runs a study; its trials, the largest error of its best trial, and the best value in units of the resolution."""
    with tempfile.TemporaryDirectory() as folder, closing(Store(f"{folder}/metaid.db", create=True)) as store:
        create_study(store, spec, "chain")
        done = run_study(store, "chain")
        shown = summary(store, "chain")
        error = shown["best"].get("max_error", shown["max_error"])  # of the best trial itself
    best = np.inf if done.best is None else done.best.outcome.value
    return done.trials, np.inf if error is None else error, best / done.problem.resolution


def chains(seeds: int) -> Iterator[tuple[str, int, int]]:
    """Every kind with every number of links, `seeds` of each."""
    for kind in KINDS:
        for nlink in LINKS:
            yield from ((kind, nlink, seed) for seed in range(seeds))


def main() -> None:
    """Prints a row for each kind, and each chain that was not found; exit status 1 if there is one."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--seeds", type=int, default=2, help="chains of each kind and number of links")
    options.add_argument("--set", dest="changes", action="append", default=[], metavar="KEY=VALUE")
    given = options.parse_args()
    changes = {
        key: parse_toml(f"value = {text}")["value"] for key, _, text in (c.partition("=") for c in given.changes)
    }
    found = []
    for kind, nlink, seed in chains(given.seeds):
        began = time.perf_counter()
        found.append(Found(kind, nlink, seed, *find(spec_of(kind, nlink, seed, changes)), time.perf_counter() - began))
    print(
        "| kind | chains | found | median trials | most trials | worst error |\n| --- | --- | --- | --- | --- | --- |"
    )
    for kind in KINDS:
        own = [each for each in found if each.kind == kind]
        trials = [each.trials for each in own]
        good = sum(each.error <= WITHIN for each in own)
        worst = max(each.error for each in own)
        print(f"| {kind} | {len(own)} | {good} | {np.median(trials):.0f} | {max(trials)} | {worst:.2g} |")
    for each in found:
        if not each.error <= WITHIN:
            print(each)
    sys.exit(0 if all(each.error <= WITHIN for each in found) else 1)


if __name__ == "__main__":
    main()
