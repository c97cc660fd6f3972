"""The paper's own search beside metaheuristics, by its own measure: trials until the gravity lumps are within 0.01.

    python -m benchmarks.paper_samplers
    python -m benchmarks.paper_samplers --links 1 --samplers dinoip cmaes --json

The plants, pushes and counting rules are those of studies/paper-one-link.toml and studies/paper-two-link.toml, all
samplers search in the factors themselves, from 1.5. Each seed has a nominal model of its own, its masses wrong by a
factor of 0.8 to 1.25, so that the truth does not lie on a grid of steps. The Coriolis lump is left out: counts do not
determine it. What counts is the last trial of least value, as in `metaid study show`, and from which trial on it stays
within 0.01 to the end of the budget.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from statistics import median

import numpy as np
from threadpoolctl import threadpool_limits

from metaid.study import Problem, load_study

STUDIES = {1: "paper-one-link", 2: "paper-two-link"}
BUDGETS = {1: 100, 2: 500}
SAMPLERS = ("dinoip", "dinoip, coarse to fine", "cmaes", "tpe", "random")
START = 1.5
WITHIN = 0.01


@dataclass(frozen=True)
class Run:
    """One search: its trials, falls among them, the trial from which on it was `WITHIN` (or None), its error at the
    end.
    """

    trials: int
    falls: int
    settled: int | None
    error: float


def search(links: int, sampler: str, seed: int) -> Run:
    """One search, until it is finished or the budget is spent."""
    problem = _problem(links, sampler, seed)
    truth = problem.open_plant().chain.lumps.vector / problem.nominal.lumps.vector
    searcher, objective = problem.make_searcher(), problem.make_objective()
    least, errors, falls = np.inf, [np.inf], 0
    while not searcher.finished() and len(errors) <= BUDGETS[links]:
        outcomes = []
        for factors in searcher.ask():
            outcomes.append(outcome := objective.evaluate(factors))
            falls += outcome.fell
            better = not outcome.fell and outcome.value <= least
            least = outcome.value if better else least
            errors.append(float(np.abs(factors / truth - 1.0)[:links].max()) if better else errors[-1])
        searcher.tell(outcomes)
    outside = np.flatnonzero(np.array(errors) > WITHIN)[-1]
    return Run(len(errors) - 1, falls, int(outside) + 1 if outside < len(errors) - 1 else None, errors[-1])


def _problem(links: int, sampler: str, seed: int) -> Problem:
    random = np.random.default_rng([links, seed])
    wrong = [{"length": 0.45, "mass": mass} for mass in np.exp(random.uniform(-1, 1, links) * np.log(1.25)).tolist()]
    name, _, how = sampler.partition(", ")
    search = {"search.start": START, "search.coarse_to_fine": bool(how)}
    changes = {"nominal": {"links": wrong}, "sampler": name, "seed": seed, "trials": BUDGETS[links], **search}
    return Problem(load_study(STUDIES[links], changes))


def main() -> None:
    """Runs the comparison and prints its table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, nargs="+", choices=STUDIES, default=list(STUDIES))
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4])
    parser.add_argument("--samplers", nargs="+", choices=SAMPLERS, default=list(SAMPLERS))
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    results: dict[tuple[int, str], list[Run]] = {}
    with threadpool_limits(1):
        for links in given.links:
            for sampler in given.samplers:
                print(f"{links} links, {sampler}", file=sys.stderr)
                results[links, sampler] = [search(links, sampler, seed) for seed in given.seeds]
    if given.json:
        rows = [
            {"links": n, "sampler": s, "budget": BUDGETS[n], "runs": [vars(r) for r in runs]}
            for (n, s), runs in results.items()
        ]
        print(json.dumps(rows, indent=2))
    else:
        print(table(results))


def table(results: dict[tuple[int, str], list[Run]]) -> str:
    """The runs as a Markdown table."""
    lines = ["| links | sampler | within 0.01 | after trials | median | falls | worst error at the end |"]
    lines.append("| --- " * 7 + "|")
    for (links, sampler), runs in results.items():
        settled = sorted(run.settled for run in runs if run.settled is not None)
        reached, middle = (
            f"{len(settled)} of {len(runs)}",
            f"{median(settled):.0f}" if len(settled) > len(runs) / 2 else "–",
        )
        falls, worst = median(run.falls for run in runs), max(run.error for run in runs)
        after = ", ".join(map(str, settled)) or "–"
        lines.append(f"| {links} | {sampler} | {reached} | {after} | {middle} | {falls:.0f} | {worst:.1%} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
