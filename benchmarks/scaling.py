"""What a cluster of up to 1,000 cores would give, and what generation it needs: an estimate, simulated from what one
worker costs on this machine.

    python -m benchmarks.scaling [--json] [--quick] [-o docs/images/scaling.png]

Measured: what a candidate costs a worker, falls and survivors of a real search (processor time); what a call to a Ray
actor costs the driver and how long an idle actor takes to answer (round trip). Simulated: generations one after
another, as metaid runs them. The driver sends the shares one by one, each worker evaluates its own, the driver takes
them in one by one, and the next generation waits for the last. Not in it: a network slower than this machine's
loopback, workers of unequal speed, the searcher's own time, the DB's.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks.common import PLANTS, Row, machine, table
from metaid.chain import Array
from metaid.problem import Problem, load_study
from metaid.ray_crew import RayCrew

CORES = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000)
GENERATIONS = (16, 64, 256, 1000, 4000, 16000)  # candidates
USE = 0.8  # of the cores' time
REPEATS = 20  # generations that are simulated
LARGEST = 10_000_000  # candidates; beyond, a cluster counts as too large


@dataclass(frozen=True)
class Costs:
    """Seconds: of `episodes`, one each; of the driver for a `call`; a `round_trip` to an idle actor."""

    links: int
    episodes: Array
    call: float
    round_trip: float

    def row(self) -> Row:
        """As a table shows it."""
        slow, middle = float(self.episodes.max()), float(np.median(self.episodes))
        names = ("links", "episode, ms", "slowest, ms", "call, ms", "round trip, ms")
        return dict(zip(names, (self.links, *(1e3 * s for s in (middle, slow, self.call, self.round_trip))), strict=True))


def measure(links: int, candidates: int) -> Costs:
    """What a chain of so many links costs on this machine."""
    problem = Problem(load_study(f"{PLANTS[links].removesuffix('-link')}-link"))
    random = np.random.default_rng(0)
    batch = random.uniform(0.8, 1.5, (candidates, len(problem.names)))
    objective = problem.make_objective()
    objective.evaluate(batch[0])
    episodes = []
    for factors in batch:
        begun = time.process_time()
        objective.evaluate(factors)
        episodes.append(time.process_time() - begun)
    return Costs(links, np.array(episodes), *_ray_costs(problem))


def _ray_costs(problem: Problem) -> tuple[float, float]:
    with RayCrew(problem, 1, None) as crew:
        crew.evaluate(problem.start[None])
        actor, ray = crew._hands[0].actor, crew._ray
        trips = []
        for _ in range(300):
            begun = time.perf_counter()
            ray.get(actor.place.remote())
            trips.append(time.perf_counter() - begun)
        begun = time.process_time()
        ray.get([actor.place.remote() for _ in range(1000)])
        call = (time.process_time() - begun) / 1000
    return call, statistics.median(trips)


def used(costs: Costs, cores: int, generation: int, random: np.random.Generator) -> float:
    """The part of the cores' time that is spent on episodes, in generations of so many candidates."""
    workers = min(cores, generation)
    sizes = np.full(workers, generation // workers) + (np.arange(workers) < generation % workers)
    busy = total = 0.0
    for _ in range(REPEATS):
        work = _sums(random.choice(costs.episodes, generation), sizes)
        sent = costs.call * (1 + np.arange(workers))
        answers = np.sort(sent + costs.round_trip + work)
        taken_in = 0.0
        for answer in answers:
            taken_in = max(taken_in, float(answer)) + costs.call
        busy, total = busy + float(work.sum()), total + taken_in
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


def draw(curves: dict[int, list[Row]], path: Path) -> None:
    """Trials per second of a cluster, as a multiple of one core's, over its cores; a line a generation."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.2), layout="constrained")
    for axes, (links, rows) in zip(np.atleast_1d(figure.subplots(1, len(curves), sharey=True)), curves.items(), strict=True):
        cores = [row["cores"] for row in rows]
        axes.plot(cores, cores, color="0.8", label="all of every core")
        for generation in GENERATIONS:
            axes.plot(cores, [row["cores"] * row[f"{generation:,}"] for row in rows], label=f"{generation:,}")
        axes.set(xscale="log", yscale="log", xlabel="cores", title=f"{links} links (simulated)")
    figure.axes[0].set_ylabel("cores' worth of trials")
    figure.axes[-1].legend(title="generation", fontsize="x-small", title_fontsize="x-small")
    figure.savefig(path, dpi=150)


def main() -> None:
    """Measures, simulates, prints; `-o` draws."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scaling", description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--quick", action="store_true", help="fewer episodes")
    parser.add_argument("-o", dest="output", type=Path, help="draw it there")
    arguments = parser.parse_args()
    with threadpool_limits(1):
        found = [measure(links, 50 if arguments.quick else 500) for links in LINKS]
    curves = {costs.links: curve(costs) for costs in found}
    if arguments.output is not None:
        draw(curves, arguments.output)
    if arguments.json:
        measured = [{**asdict(costs), "episodes": costs.episodes.tolist()} for costs in found]
        print(json.dumps({"machine": machine(), "measured": measured, "use": curves}, indent=2))
        return
    print(f"Measured on this machine:\n\n{table([costs.row() for costs in found])}")
    for links, rows in curves.items():
        print(f"\nSimulated, {links} links: part of the cores' time spent on episodes, by generation:\n\n{table(rows)}")


if __name__ == "__main__":
    main()
