"""Whether a run until intervals are narrow takes what was foreseen, and whether the truth is where it then says.

    python -m benchmarks.until
    python -m benchmarks.until --until 0.005 --chains 5

Chains of three links (`benchmarks/chains.py`), nominal models that are wrong by 30 %, so much noise that a trial is not
enough: 10 mrad on the angles, no speed sensor, pushes that differ by 10 %. `study check --until` is asked beforehand.
"""

from __future__ import annotations

import argparse
import logging
from dataclasses import dataclass

from threadpoolctl import threadpool_limits

from benchmarks.chain_study import chain_study
from benchmarks.chains import random_chain
from benchmarks.common import made, table
from metaid.results import summary
from metaid.study import Problem, forecast, run_study

LINKS = 3
NOISE = {"angle_noise": 0.01, "speed_sensor": False, "push_noise": 0.1}
ALLOWED = 1.5  # times the pushes that were foreseen


@dataclass(frozen=True)
class Ended:
    """A run until intervals are narrow: pushes that were `foreseen` and that it `took`, whether it is `found`; half the
    widest interval and the largest error, as shares; how many lumps are inside their intervals, and how many there are.
    """

    seed: int
    foreseen: int
    took: int
    found: bool
    half_width: float
    error: float
    inside: int
    lumps: int


def run_until(seed: int, until: float) -> Ended:
    """Asks beforehand, and runs the study of the chain of that seed."""
    spec = chain_study(random_chain(LINKS, seed), 4, seed, NOISE)
    problem = Problem(spec)
    foreseen = forecast(problem, until)
    with made(spec) as (store, name):
        run_study(store, name, workers=1, until=until)
        shown = summary(store, name)
    known = [lump for lump in shown["lumps"] if lump["determined"]]
    inside = sum(lump["low"] <= lump["true"] <= lump["high"] for lump in known)
    widest = max((lump["high"] - lump["low"]) / (2.0 * lump["identified"]) for lump in known)
    took = shown["trials"]["total"] * len(problem.episode.pushes)
    is_found = shown["verdict"] == "found" and len(known) == len(shown["lumps"])
    return Ended(seed, foreseen.pushes, took, is_found, widest, shown["max_error"], inside, len(shown["lumps"]))


def main() -> None:
    """Runs what is asked for and prints a row a chain, and the sums."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--until", type=float, default=0.01, help="half an interval, as a share of its lump")
    parser.add_argument("--chains", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed")
    given = parser.parse_args()
    logging.disable()
    with threadpool_limits(1):
        rows = [run_until(seed, given.until) for seed in range(given.first, given.first + given.chains)]
    shown = [
        {
            "chain": row.seed,
            "pushes foreseen": row.foreseen,
            "taken": row.took,
            "widest": f"{row.half_width:.2%}",
            "largest error": f"{row.error:.2%}",
            "inside": f"{row.inside} of {row.lumps}",
        }
        for row in rows
    ]
    print(table(shown))
    within = sum(row.found and row.half_width <= given.until and row.took <= ALLOWED * row.foreseen for row in rows)
    print(f"\n{within} of {len(rows)} ended within {ALLOWED} times the pushes foreseen")
    print(f"{sum(row.error <= given.until for row in rows)} have every lump within {given.until:.2%} of the truth")
    print(f"{sum(row.inside == row.lumps for row in rows)} have every true lump inside its own interval; of all lumps,")
    print(f"{sum(row.inside for row in rows) / sum(row.lumps for row in rows):.0%} are")


if __name__ == "__main__":
    main()
