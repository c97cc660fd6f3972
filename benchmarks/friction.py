"""Friction: how often it is found with the other lumps, and what it does where it is not searched.

    python -m benchmarks.friction                       # all parts, N = 2, 3, 5, ten chains each
    python -m benchmarks.friction --links 10 --parts viscous --seeds 0 1 2 3 4

Chains and nominal models are those of benchmarks/chains.py, with friction in every joint: damping of
0.2 × U(0.5, 1.5) × √(g/l) × (I_i + m_i c_i²), so that a link alone would lose a fifth of its speed in about √(l/g), and
dry friction of 0.05 × U(0.5, 1.5) × g m_i c_i; nominal values are true × U(0.7, 1.3).

**viscous**: gravity, Coriolis and viscous friction lumps. **dry**: those and dry friction. The sampler is `cmaes`. A
run ends when every lump is within 0.1 %, its searcher is finished, or after 6,000 trials (10,000 at ten links).
"""

from __future__ import annotations

import argparse
import json
from contextlib import closing
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.chains import Links, random_chain
from benchmarks.common import table
from metaid.models import FRICTION, IDEAL, Array
from metaid.plant import PlantSettings, chain_of
from metaid.study import Problem, StudySettings, StudySpec
from metaid.study.evaluation import ThreadEvaluator

MOST = 6000
MOST_AT_TEN = 10_000
DAMPED, DRY = 0.2, 0.05
PARTS = ["viscous", "dry"]


@dataclass(frozen=True)
class Searched:
    """The search of one chain: trials until its worst lump was within 1 % and 0.1 % (None: never), and in all; the
    error of its worst lump in the end, and the median error.
    """

    part: str
    links: int
    lumps: int
    seed: int
    nominal_error: float
    trials_1: int | None
    trials_01: int | None
    trials: int
    error: float
    median_error: float


def rubbing_chain(nlink: int, seed: int) -> tuple[Links, Links]:
    """The true and the nominal links of a random chain with the friction named above."""
    pair = random_chain(nlink, seed)
    random, true = np.random.default_rng([nlink, seed, 1]), chain_of(pair[0])
    rate = np.sqrt(9.81 / true.length.mean())
    damping = DAMPED * rate * (true.inertia + true.mass * true.com**2) * random.uniform(0.5, 1.5, nlink)
    dry = DRY * 9.81 * true.mass * true.com * random.uniform(0.5, 1.5, nlink)
    believed = random.uniform(0.7, 1.3, (2, nlink))

    def rubbing(links: Links, damping: Array, dry: Array) -> Links:
        return tuple(
            link.model_copy(update={"damping": b, "frictionloss": c})
            for link, b, c in zip(links, damping.tolist(), dry.tolist(), strict=True)
        )

    return rubbing(pair[0], damping, dry), rubbing(pair[1], damping * believed[0], dry * believed[1])


def without_dry(links: Links) -> Links:
    """The same without dry friction."""
    return tuple(link.model_copy(update={"frictionloss": 0.0}) for link in links)


def search(part: str, seed: int, pair: tuple[Links, Links]) -> Searched:
    """What a search finds."""
    true, nominal = pair
    nlink = len(true)
    kinds = {"viscous": (*IDEAL, "damping"), "dry": (*IDEAL, *FRICTION)}[part]
    most = MOST_AT_TEN if nlink >= 10 else MOST
    settings: dict[str, Any] = {"plant": "chain", "nominal": "nominal", "trials": most, "seed": seed}
    study = StudySettings.model_validate({**settings, "sampler": "cmaes", "search": {"lumps": kinds}})
    plant = PlantSettings(links=true)
    problem = Problem(StudySpec(name="chain", plant_name="chain", plant=plant, nominal=nominal, study=study))
    truth = chain_of(true).lumps_of(problem.chain.lumps.searched).vector / problem.chain.lumps.vector
    searcher, trials, best, factors = problem.make_searcher(), 0, np.inf, problem.robot.start
    reached: dict[float, int] = {}
    with closing(ThreadEvaluator(problem, 2)) as evaluator:
        while trials < most and not searcher.finished() and 0.001 not in reached:
            batch = searcher.ask()
            outcomes = evaluator.evaluate(batch)
            for candidate, outcome in zip(batch, outcomes, strict=True):
                trials += 1
                if outcome.value < best:
                    best, factors = outcome.value, candidate
                    error = np.abs(factors / truth - 1.0).max()
                    for within in (0.01, 0.001):
                        if error <= within:
                            reached.setdefault(within, trials)
            searcher.tell(outcomes)
    errors = np.abs(factors / truth - 1.0)
    return Searched(
        part=part,
        links=nlink,
        lumps=len(truth),
        seed=seed,
        nominal_error=float(np.abs(1.0 / truth - 1.0).max()),
        trials_1=reached.get(0.01),
        trials_01=reached.get(0.001),
        trials=trials,
        error=float(errors.max()),
        median_error=float(np.median(errors)),
    )


def shown(runs: list[Searched]) -> list[dict[str, Any]]:
    """A row for all runs of the same kind: how many got there, and medians."""
    rows = []
    for links in dict.fromkeys(run.links for run in runs):
        own = [r for r in runs if r.links == links]
        row: dict[str, Any] = {"links": links, "lumps": own[0].lumps}
        counts = [[getattr(r, key) for r in own if getattr(r, key) is not None] for key in ("trials_1", "trials_01")]
        for within, got in zip(("1 %", "0.1 %"), counts, strict=True):
            row[f"within {within}"] = f"{len(got)} of {len(own)}"
            row[f"trials to {within}"] = f"{median(got):,.0f}" if got else "–"
        rows.append(row | {"worst error, %": f"{100 * max(r.error for r in own):.2f}"})
    return rows


def main() -> None:
    """Runs what is asked for and prints tables or JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.friction")
    parser.add_argument("--links", type=int, nargs="+", default=[2, 3, 5])
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(10)))
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    found: dict[str, list[Searched]] = {part: [] for part in arguments.parts}
    with threadpool_limits(1):
        for part in arguments.parts:
            for links in arguments.links:
                for seed in arguments.seeds:
                    true, nominal = rubbing_chain(links, seed)
                    pair = (true, nominal) if part == "dry" else (without_dry(true), without_dry(nominal))
                    found[part].append(search(part, seed, pair))
    if arguments.json:
        print(json.dumps({part: [asdict(run) for run in runs] for part, runs in found.items()}))
        return
    for part, runs in found.items():
        print(f"**{part}**\n\n{table(shown(runs))}\n")


if __name__ == "__main__":
    main()
