"""metaid beside what else identifies a chain, on the same chains with the same wrong nominal models, in one run.

    python -m benchmarks.peers --links 1,2,3,5 --seeds 5

metaid pushes the chain and sees angles and speeds. The others see torques: they get recordings of the same chain along
rich trajectories under computed torque of the same nominal model (`recording.py`), perfect, or with normal noise of
1 mrad on every angle and derivatives filtered from it.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from statistics import median

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.by_torque import Found, least_squares, mujoco_sysid
from benchmarks.chains import Links, random_chain
from benchmarks.recording import record, with_noise
from metaid.cli.common import print_table
from metaid.models import Array
from metaid.plant import PlantSettings, chain_of
from metaid.study import Problem, StudySettings, StudySpec

SUCCESS = 0.01  # worst lump error
TRIALS_PER_LUMP = 200  # after which metaid gives up
STILL = 0.3  # of the measure's resolution: coasting that cannot be told from perfect, where metaid stops

NEEDS = {
    "metaid, cmaes": "joint angles and speeds after pushes",
    "metaid, newton": "joint angles and speeds after pushes",
    "sysid": "joint angles, joint torques, speeds where a window starts; link lengths",
    "sysid, 1 mrad": "joint angles, joint torques; link lengths",
    "least squares": "joint angles, speeds, accelerations, torques",
    "least squares, 1 mrad": "joint angles, joint torques",
}


@dataclass(frozen=True)
class Result:
    """One method on one chain: worst relative error of gravity and Coriolis lumps, and of inertia lumps where they are
    found; `plant_s`, seconds of motion of the plant; `cpu_s`, of computing on one thread, for metaid simulating the
    plant as well."""

    method: str
    nlink: int
    seed: int
    error: float
    inertia_error: float | None
    plant_s: float
    cpu_s: float
    trials: int | None


def metaid_search(true: Links, nominal: Links, seed: int, sampler: str) -> Found:
    """What a study with metaid's own settings and this sampler finds, as `study run` runs it.

    It stops where it cannot tell the coasting from perfect, or gives up; it never sees the true lumps.
    """
    nlump = len(chain_of(nominal).lumps.vector)
    settings = StudySettings.model_validate(
        {
            "plant": "chain",
            "nominal": "nominal",
            "sampler": sampler,
            "trials": TRIALS_PER_LUMP * nlump,
            "seed": seed,
        }
    )
    problem = Problem(
        StudySpec(name="peers", plant_name="chain", plant=PlantSettings(links=true), nominal=nominal, study=settings)
    )
    searcher, objective = problem.make_searcher(), problem.make_objective()
    best, lowest, trials, steps = problem.start, np.inf, 0, 0
    while trials < settings.trials and lowest > STILL * problem.resolution and not searcher.finished():
        batch = searcher.ask()
        outcomes = [objective.evaluate(factors) for factors in batch]
        searcher.tell(outcomes)
        trials += len(outcomes)
        steps += sum(outcome.steps for outcome in outcomes)
        for factors, outcome in zip(batch, outcomes, strict=True):
            if not outcome.fell and outcome.value < lowest:
                best, lowest = factors, outcome.value
    return Found(problem.nominal.lumps.scaled(best).vector, None, steps * problem.timestep, trials)


def compare(nlink: int, seed: int) -> Iterator[Result]:
    """Every method on one chain."""
    true, nominal = random_chain(nlink, seed)
    chain, gravity = chain_of(true), PlantSettings.model_fields["gravity"].default
    clean = record(true, nominal, seed)
    noisy = with_noise(clean, nominal, gravity, seed)
    methods: dict[str, Callable[[], Found]] = {
        "metaid, cmaes": lambda: metaid_search(true, nominal, seed, "cmaes"),
        "metaid, newton": lambda: metaid_search(true, nominal, seed, "newton"),
        "sysid": lambda: mujoco_sysid(clean, nominal, gravity),
        "sysid, 1 mrad": lambda: mujoco_sysid(noisy, nominal, gravity),
        "least squares": lambda: least_squares(clean, nominal, gravity),
        "least squares, 1 mrad": lambda: least_squares(noisy, nominal, gravity),
    }
    for method, identify in methods.items():
        started = time.process_time()
        found = identify()
        cpu_s = time.process_time() - started
        error = _worst(found.lumps, chain.lumps.vector)
        inertia = None if found.inertia_lumps is None else _worst(found.inertia_lumps, chain.inertia_lumps)
        yield Result(method, nlink, seed, error, inertia, found.plant_s, cpu_s, found.trials)


def _worst(found: Array, true: Array) -> float:
    return float(np.abs(found / true - 1.0).max())


def table(results: list[Result]) -> list[list[str]]:
    """One row per number of links and method: medians over the seeds, and how many were found to 1 %."""
    rows = []
    for nlink in sorted({result.nlink for result in results}):
        for method in NEEDS:
            own = [result for result in results if (result.nlink, result.method) == (nlink, method)]
            errors = [result.error for result in own]
            inertia = [result.inertia_error for result in own if result.inertia_error is not None]
            trials = [result.trials for result in own if result.trials is not None]
            rows.append(
                [
                    method,
                    str(nlink),
                    f"{sum(error <= SUCCESS for error in errors)} of {len(own)}",
                    f"{median(errors):.1e}",
                    f"{max(errors):.1e}",
                    f"{median(inertia):.1e}" if inertia else "–",
                    f"{median(result.plant_s for result in own):.0f}",
                    f"{median(result.cpu_s for result in own):.2g}",
                    f"{median(trials):.0f}" if trials else "–",
                ]
            )
    return rows


HEADING = [
    "method",
    "links",
    "within 1 %",
    "worst lump, median",
    "largest",
    "inertia lumps, median",
    "motion, s",
    "computing, CPU s",
    "trials",
]
NOTE = (
    "worst lump: relative error, gravity and Coriolis; motion: of the plant, that the method had to see; "
    "computing: one thread; metaid's includes simulating the plant; metaid was given no noise"
)


def main() -> None:
    """Compares and prints."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--links", default="1,2,3,5", help="numbers of links, e.g. 1,2,3,5")
    options.add_argument("--seeds", type=int, default=5, help="chains of each")
    options.add_argument("--quick", action="store_true", help="two chains of 1 and 2 links")
    options.add_argument("--json", action="store_true", help="every single result, as JSON")
    given = options.parse_args()
    links, seeds = ([1, 2], 2) if given.quick else ([int(text) for text in given.links.split(",")], given.seeds)
    results: list[Result] = []
    with threadpool_limits(1):
        # Compiles the loop, which is no part of what is compared.
        metaid_search(*random_chain(1, 0), seed=0, sampler="cmaes")
        for nlink in links:
            for seed in range(seeds):
                results += compare(nlink, seed)
                print(f"{nlink} links, chain {seed + 1} of {seeds}", file=sys.stderr)
    if given.json:
        print(json.dumps([asdict(result) for result in results], indent=2))
    else:
        print_table("What must be measured", ["method", "measured or known"], [list(row) for row in NEEDS.items()])
        print_table("On the same chains, with the same wrong nominal models", HEADING, table(results), NOTE)


if __name__ == "__main__":
    main()
