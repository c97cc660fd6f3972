"""What a cluster of up to 1,000 cores would give, and what generation it needs: an estimate, simulated from what one
worker costs on this machine.

    python -m benchmarks.scaling [--json] [--quick] [-o docs/images/scaling.png]

Measured: what a candidate costs a worker, over the candidates of a real search (processor time); what a call to a Ray
actor costs the driver, what a look at one that it waits for, and how long an idle one takes to answer (round trip).
Simulated: generations one after another, as metaid runs them. The driver sends the shares one by one, each worker
evaluates its own, the driver looks at all that it waits for and takes in what is there, and the next generation waits
for the last. Not in it: a network slower than this machine's loopback, workers of unequal speed, the searcher's own
time, the DB's.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks.common import Row, machine, make_spec, table
from metaid.models import Array
from metaid.study import Problem, load_study
from metaid.study.evaluation import RayEvaluator

STUDIES = {
    "three-link-coast": lambda: load_study("three-link-coast"),
    "ten-link": lambda: load_study("ten-link", {"sampler": "cmaes"}),
    "ten links, 5,000 steps a push": lambda: make_spec(10, steps=20 * 5000),
}
MOST_SECONDS = 10.0  # of episodes, of a study
CORES = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000)
GENERATIONS = (16, 64, 256, 1000, 4000, 16000)  # candidates
USE = 0.8  # of the cores' time
REPEATS = 20  # generations that are simulated
LARGEST = 10_000_000  # candidates; beyond, a cluster counts as too large


@dataclass(frozen=True)
class Costs:
    """Seconds: of `episodes`, one each; of the driver for a `call`, and for a `look` at each worker that it waits for;
    a `round_trip` to an idle actor.
    """

    study: str
    episodes: Array
    call: float
    look: float
    round_trip: float

    def row(self) -> Row:
        """As a table shows it."""
        slow, middle = float(self.episodes.max()), float(np.median(self.episodes))
        costs = {
            "episode": middle,
            "slowest": slow,
            "call": self.call,
            "look": self.look,
            "round trip": self.round_trip,
        }
        return {"study": self.study, **{f"{name}, ms": 1e3 * seconds for name, seconds in costs.items()}}


def measure(study: str, candidates: int) -> Costs:
    """What the first candidates of a study cost on this machine."""
    problem = Problem(STUDIES[study]())
    objective, searcher = problem.make_objective(), problem.make_searcher()
    objective.evaluate(problem.robot.start)
    episodes: list[float] = []
    while len(episodes) < candidates and sum(episodes) < MOST_SECONDS and not searcher.finished():
        outcomes = []
        for factors in searcher.ask():
            begun = time.process_time()
            outcomes.append(objective.evaluate(factors))
            episodes.append(time.process_time() - begun)
        searcher.tell(outcomes)
    return Costs(study, np.array(episodes), *_ray_costs(problem))


def _ray_costs(problem: Problem) -> tuple[float, float, float]:
    with closing(RayEvaluator(problem, 1, None)) as evaluator:
        evaluator.evaluate(problem.robot.start[None])
        actor, ray = evaluator._actors[0].handle, evaluator._ray
        trips = []
        for _ in range(300):
            begun = time.perf_counter()
            ray.get(actor.location.remote())
            trips.append(time.perf_counter() - begun)
        begun = time.process_time()
        ray.get([actor.location.remote() for _ in range(1000)])
        call = (time.process_time() - begun) / 1000
        ray.get(calls := [actor.location.remote() for _ in range(1000)])
        begun = time.process_time()
        for _ in range(10):
            ray.wait(calls, num_returns=len(calls), timeout=0.0)
        look = (time.process_time() - begun) / 10 / len(calls)
    return call, look, statistics.median(trips)


def used(costs: Costs, cores: int, generation: int, random: np.random.Generator) -> float:
    """The part of the cores' time that is spent on episodes, in generations of so many candidates."""
    workers = min(cores, generation)
    sizes = np.full(workers, generation // workers) + (np.arange(workers) < generation % workers)
    busy = total = 0.0
    for _ in range(REPEATS):
        work = _sums(random.choice(costs.episodes, generation), sizes)
        sent = 0.5 * costs.call * (1 + np.arange(workers))
        answers = np.sort(sent + costs.round_trip + work)
        now, done = 0.0, 0
        while done < workers:
            now = max(now, float(answers[done])) + 2.0 * costs.look * (workers - done)
            there = int(np.searchsorted(answers, now, side="right"))
            now, done = now + 0.5 * costs.call * (there - done), there
        busy, total = busy + float(work.sum()), total + now
    return busy / (cores * total)


def _sums(values: Array, sizes: NDArray[np.int64]) -> Array:
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    sums: Array = np.add.reduceat(values, starts)
    return sums


def needed(costs: Costs, cores: int, random: np.random.Generator) -> int | None:
    """The least generation, of powers of two times the cores, that uses USE of them; None if it is beyond LARGEST."""
    generation = cores
    while generation <= LARGEST:
        if used(costs, cores, generation, random) >= USE:
            return generation
        generation *= 2
    return None


def curve(costs: Costs) -> list[Row]:
    """Cores, the use of them by generation, and the generation that uses them well."""
    random = np.random.default_rng(1)
    return [
        {
            "cores": cores,
            **{f"{generation:,}": used(costs, cores, generation, random) for generation in GENERATIONS},
            f"generation for {USE:.0%}": needed(costs, cores, random),
        }
        for cores in CORES
    ]


def draw(curves: dict[str, list[Row]], path: Path) -> None:
    """Trials per second of a cluster, as a multiple of one core's, over its cores; a line a generation."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.2), layout="constrained")
    for axes, (study, rows) in zip(figure.subplots(1, len(curves), sharey=True), curves.items(), strict=True):
        cores = [row["cores"] for row in rows]
        axes.plot(cores, cores, color="0.8", label="all of every core")
        for generation in GENERATIONS:
            axes.plot(cores, [row["cores"] * row[f"{generation:,}"] for row in rows], label=f"{generation:,}")
        axes.set(xscale="log", yscale="log", xlabel="cores", title=study)
    figure.suptitle("Simulated from the costs of one worker", fontsize="medium")
    figure.axes[0].set_ylabel("cores' worth of trials")
    figure.axes[-1].legend(title="generation", fontsize="x-small", title_fontsize="x-small")
    figure.savefig(path, dpi=100)


def main() -> None:
    """Measures, simulates, prints; `-o` draws."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.scaling",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--quick", action="store_true", help="fewer episodes")
    parser.add_argument("-o", dest="output", type=Path, help="draw it there")
    arguments = parser.parse_args()
    with threadpool_limits(1):
        found = [measure(study, 50 if arguments.quick else 500) for study in STUDIES]
    curves = {costs.study: curve(costs) for costs in found}
    if arguments.output is not None:
        draw(curves, arguments.output)
    if arguments.json:
        measured = [{**asdict(costs), "episodes": costs.episodes.tolist()} for costs in found]
        print(json.dumps({"machine": machine(), "measured": measured, "use": curves}, indent=2))
        return
    print(f"Measured on this machine:\n\n{table([costs.row() for costs in found])}")
    for study, rows in curves.items():
        print(f"\nSimulated, {study}: part of the cores' time spent on episodes, by generation:\n\n{table(rows)}")


if __name__ == "__main__":
    main()
