"""Whether a run until all lumps are known takes what was foreseen, and whether the truth is where it then says.

    python -m benchmarks.until
    python -m benchmarks.until --until 0.005 --chains 5

Chains of three links (`benchmarks/chains.py`), nominal models that are wrong by 30 %, so much noise that a trial is not
enough: 10 mrad on the angles, no speed sensor, pushes that differ by 10 %. `study check --until` is asked beforehand.
"""

from __future__ import annotations

import argparse
import logging
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.chain_study import chain_study
from benchmarks.chains import random_chain
from benchmarks.common import made, table
from metaid.models import DEVIATIONS, deviations_at_once
from metaid.results import summary
from metaid.study import Problem, forecast, run_study

LINKS = 3
NOISE = {"angle_noise": 0.01, "speed_sensor": False, "push_noise": 0.1}
ALLOWED = 1.5  # times the pushes that were foreseen


@dataclass(frozen=True)
class Ended:
    """A run until all lumps are known: pushes that were `foreseen` and that it `took`, whether it is `found`; half the
    widest of the intervals that hold all at once, and the largest error, as shares; how many lumps are inside these
    intervals, how many inside those of 95 % each, and how many there are.
    """

    seed: int
    foreseen: int
    took: int
    found: bool
    half_width: float
    error: float
    inside: int
    inside_own: int
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
    wider = deviations_at_once(len(known)) / DEVIATIONS
    own, inside = (
        sum(
            abs(np.log(lump["true"] / lump["identified"])) <= 0.5 * times * np.log(lump["high"] / lump["low"])
            for lump in known
        )
        for times in (1.0, wider)
    )
    took = shown["trials"]["total"] * len(problem.episode.pushes)
    is_found = shown["verdict"] == "found" and len(known) == len(shown["lumps"])
    return Ended(
        seed,
        foreseen.pushes,
        took,
        is_found,
        shown["estimate"]["half_width"],
        shown["max_error"],
        inside,
        own,
        len(shown["lumps"]),
    )


def main() -> None:
    """Runs what is asked for and prints a row a chain, and the sums."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--until", type=float, default=0.01, help="to what share all lumps are to be known")
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
            "known to": f"{row.half_width:.2%}",
            "largest error": f"{row.error:.2%}",
            "inside, all at once": f"{row.inside} of {row.lumps}",
            "inside, each": f"{row.inside_own} of {row.lumps}",
        }
        for row in rows
    ]
    print(table(shown))
    within = sum(row.found and row.half_width <= given.until and row.took <= ALLOWED * row.foreseen for row in rows)
    print(f"\n{within} of {len(rows)} ended within {ALLOWED} times the pushes foreseen")
    print(f"{sum(row.error <= given.until for row in rows)} have every lump within {given.until:.2%} of the truth")
    print(f"{sum(row.inside == row.lumps for row in rows)} have all true lumps inside intervals that hold all at once")
    own = sum(row.inside_own for row in rows) / sum(row.lumps for row in rows)
    print(f"{own:.0%} of all lumps are inside their own interval of 95 %")


if __name__ == "__main__":
    main()
