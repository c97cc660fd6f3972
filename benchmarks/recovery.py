"""How many trials, steps and seconds it takes to identify all lumps of random chains, by number of links.

    python -m benchmarks.recovery                       # N = 3, 5 and 7, five chains each
    python -m benchmarks.recovery --links 3 5 --seeds 0 1 --samplers tpe cmaes --json

Every chain has lengths, masses, centres of mass and inertias of its own (benchmarks/chains.py), and a nominal model
whose masses and inertias are wrong by up to 30 % and centres of mass by up to 15 %. A run ends when the worst lump of
the best trial is within 0.1 % of the truth, which only this script looks at. With `--samplers output-error` that is the
trial that the law of an estimate is sent in; the inertia lumps of the estimate are in benchmarks/matching.py, of the
same chains. With `--results FILE` finished runs are kept, and a stopped benchmark goes on.
"""

from __future__ import annotations

import argparse
import json
import time
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.chains import random_chain
from benchmarks.common import resumed
from metaid.plant import LinkSettings, PlantSettings, chain_of
from metaid.study import Problem, StudySettings, StudySpec
from metaid.study.evaluation import ThreadEvaluator

LINKS = (3, 5, 7)
MOST_TRIALS = 40_000
MOST_SECONDS = 400.0


@dataclass(frozen=True)
class Recovery:
    """One run: what it took until the worst lump was within 1 % and 0.1 % (None: never), and what it cost in all."""

    links: int
    lumps: int
    seed: int
    sampler: str
    nominal_error: float
    trials_1: int | None
    seconds_1: float | None
    trials_01: int | None
    seconds_01: float | None
    cpu_seconds: float
    steps: int
    falls: int
    final_error: float


def recover(
    links: int,
    seed: int,
    sampler: str,
    workers: int,
    coordinates: str = "nominal-metric",
    pushes: str = "rich",
    spoiled: float = 1.0,
    most_trials: int = MOST_TRIALS,
) -> Recovery:
    """Identifies one chain; set-up and compilation are not in its seconds.

    `spoiled` raises every nominal error to a power: 2 turns a mass that is 1.2 times the true one into 1.44 times.
    """
    true, nominal = random_chain(links, seed)
    nominal = tuple(_spoil(*pair, spoiled) for pair in zip(true, nominal, strict=True))
    settings = {"plant": "chain", "nominal": "nominal", "trials": most_trials, "seed": seed, "sampler": sampler}
    search = {"coordinates": coordinates, "low": 0.2, "high": 5.0} if spoiled > 1.0 else {"coordinates": coordinates}
    study = StudySettings.model_validate({**settings, "search": search, "episode": {"pushes": pushes}})
    plant = PlantSettings(links=true)
    problem = Problem(StudySpec(name="chain", plant_name="chain", plant=plant, nominal=nominal, study=study))
    truth = chain_of(true).lumps.vector / problem.nominal.lumps.vector
    searcher = problem.make_searcher()
    reached: dict[float, tuple[int, float]] = {}
    trials = steps = falls = 0
    best, error = np.inf, np.inf
    with closing(ThreadEvaluator(problem, workers)) as evaluator:
        evaluator.evaluate(problem.robot.start[None])
        began, cpu = time.perf_counter(), time.process_time()
        while 0.001 not in reached and trials < most_trials and time.perf_counter() - began < MOST_SECONDS:
            batch = searcher.ask()
            outcomes = evaluator.evaluate(batch)
            for factors, outcome in zip(batch, outcomes, strict=True):
                trials, steps, falls = trials + 1, steps + outcome.steps, falls + outcome.fell
                if outcome.value < best:
                    best, error = outcome.value, float(np.abs(factors / truth - 1.0).max())
                    for within in (0.01, 0.001):
                        if error <= within:
                            reached.setdefault(within, (trials, time.perf_counter() - began))
            searcher.tell(outcomes)
            if searcher.finished():
                break
    return Recovery(
        links=links,
        lumps=len(truth),
        seed=seed,
        sampler=sampler,
        nominal_error=float(np.abs(1.0 / truth - 1.0).max()),
        trials_1=reached.get(0.01, (None, None))[0],
        seconds_1=reached.get(0.01, (None, None))[1],
        trials_01=reached.get(0.001, (None, None))[0],
        seconds_01=reached.get(0.001, (None, None))[1],
        cpu_seconds=time.process_time() - cpu,
        steps=steps,
        falls=falls,
        final_error=error,
    )


def _spoil(true: LinkSettings, nominal: LinkSettings, power: float) -> LinkSettings:
    changed = {}
    for name in ("mass", "com", "inertia"):
        exact, believed = getattr(true, name), getattr(nominal, name)
        changed[name] = exact * (believed / exact) ** power
    changed["com"] = min(changed["com"], nominal.length)
    return nominal.model_copy(update=changed)


def growth(rows: list[Recovery], what: str) -> float | None:
    """The exponent p of `what` ∝ lumps^p, from the medians by number of links, three links and more."""
    medians = {
        links: median(getattr(row, what) for row in rows if row.links == links and getattr(row, what) is not None)
        for links in sorted({row.links for row in rows if row.links >= 3 and getattr(row, what) is not None})
    }
    if len(medians) < 2:
        return None
    lumps = [links * (links + 1) / 2 for links in medians]
    return float(np.polyfit(np.log(lumps), np.log(list(medians.values())), 1)[0])


def table(rows: list[Recovery]) -> str:
    """The results as a Markdown table, medians over the chains that got there."""
    heading = ["sampler", "links", "lumps", "within 1 %", "within 0.1 %", "trials to 1 %", "trials to 0.1 %"]
    heading += ["wall s to 1 %", "steps, millions", "falls"]
    lines = [f"| {' | '.join(heading)} |", "| --- " * len(heading) + "|"]
    for sampler in dict.fromkeys(row.sampler for row in rows):
        for links in sorted({row.links for row in rows}):
            runs = [row for row in rows if (row.sampler, row.links) == (sampler, links)]
            if not runs:
                continue

            def middle(what: str, runs: list[Recovery] = runs, form: str = ",.0f") -> str:
                got = [getattr(row, what) for row in runs if getattr(row, what) is not None]
                return format(median(got), form) if got else "–"

            counts = [
                f"{sum(getattr(row, what) is not None for row in runs)} of {len(runs)}"
                for what in ("trials_1", "trials_01")
            ]
            millions = median(row.steps for row in runs) / 1e6
            cells = [sampler, str(links), str(runs[0].lumps), *counts, middle("trials_1"), middle("trials_01")]
            cells += [middle("seconds_1", form=".2f"), f"{millions:.2f}", middle("falls")]
            lines.append(f"| {' | '.join(cells)} |")
    for sampler in dict.fromkeys(row.sampler for row in rows):
        own = [row for row in rows if row.sampler == sampler]
        trials, seconds = growth(own, "trials_1"), growth(own, "seconds_1")
        if trials is not None and seconds is not None:
            grown = f"trials to 1 % grow as lumps^{trials:.2f}, wall time as lumps^{seconds:.2f}"
            lines.append(f"\n{sampler}: {grown} (three links and more).")
    return "\n".join(lines)


def main() -> None:
    """Runs what is asked for, with a line on stderr for every finished run, and prints the table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, nargs="+", default=list(LINKS), help="numbers of links")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4], help="of the chains")
    parser.add_argument("--samplers", nargs="+", default=["cmaes"])
    parser.add_argument("--pushes", choices=["rich", "designed"], default="rich")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--results", type=Path, help="a file of finished runs, one JSON object a line")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    wanted = [(sampler, links, seed) for sampler in given.samplers for links in given.links for seed in given.seeds]

    def measure(sampler: str, links: int, seed: int) -> Recovery:
        return recover(links, seed, sampler, given.workers, pushes=given.pushes)

    def describe(row: Recovery) -> str:
        is_near = row.trials_1 is not None
        reached = f"1 % after {row.trials_1} trials, {row.seconds_1:.2f} s" if is_near else "not within 1 %"
        return f"{reached}; at last {row.final_error:.2%}"

    with threadpool_limits(1):
        rows = resumed(Recovery, wanted, measure, describe, given.results)
    print(json.dumps([asdict(row) for row in rows], indent=2) if given.json else table(rows))


if __name__ == "__main__":
    main()
