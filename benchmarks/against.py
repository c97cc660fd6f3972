"""Whether a change has cost speed: the engine's and the study's figures of this checkout over those of another.

python -m benchmarks.against CHECKOUT [--rounds N] [--parts engine study]

A round is a new process of each checkout. The two take turns of some seconds, so that what slows the machine slows
both. Rounds are many, because where a process has its code and data in memory moves its speed by some percent. A row is
a figure of the tables that `benchmarks.engine` and `benchmarks.study` print, each a ratio to a peer of the same run:
bare `mj_step`, or plain Optuna. It is the median over rounds of this checkout's figure over the other's: above 1 this
one is faster. The quartiles are those of the rounds. Of studies there are the steps per second, too: those of plain
Optuna, the same code in both, tell how much noise there is.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

from benchmarks.common import Row, table

HERE = Path(__file__).parent.parent
FIGURES = {"engine": ("mj_step ÷ bare", "direct ÷ bare"), "study": ("metaid is faster by", "steps/s")}
TURNS = 3  # in a round
# Run in either checkout: prints the tables of a benchmark whenever a line arrives.
MEASURE = """
import json, sys
from benchmarks.{0} import measure
for _ in sys.stdin:
    print(json.dumps(measure(True)), flush=True)
"""


class Checkout:
    """A process in a checkout that measures one benchmark whenever it is asked."""

    def __init__(self, folder: Path, benchmark: str) -> None:
        self._benchmark = benchmark
        self._process = subprocess.Popen(
            [sys.executable, "-c", MEASURE.format(benchmark)],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(folder)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def figures(self) -> dict[str, float]:
        """What one run of the benchmark gives, by row and column."""
        assert self._process.stdin is not None, "it is a pipe"
        assert self._process.stdout is not None, "it is a pipe"
        print(file=self._process.stdin, flush=True)
        return {
            f"{self._benchmark}: {_row_name(row)}, {column}": row[column]
            for rows in json.loads(self._process.stdout.readline()).values()
            for row in rows
            for column in row
            if column in FIGURES[self._benchmark]
        }

    def close(self) -> None:
        """Ends the process."""
        self._process.communicate()


def _row_name(row: Row) -> str:
    named = [value for value in row.values() if isinstance(value, str)]
    return " ".join([f"{row['links']} links", *named] if "links" in row else named)


def compare(other: Path, benchmark: str, rounds: int) -> dict[str, list[float]]:
    """This checkout's figures over those of the `other`, one of each round; who is first takes turns too."""
    ratios: dict[str, list[float]] = defaultdict(list)
    for number in range(rounds):
        checkouts = Checkout(HERE, benchmark), Checkout(other, benchmark)
        turns: dict[str, list[float]] = defaultdict(list)
        for turn in range(number, number + TURNS):
            found = {index: checkouts[index].figures() for index in ((0, 1) if turn % 2 else (1, 0))}
            for name in found[0].keys() & found[1].keys():
                turns[name].append(found[0][name] / found[1][name])
        for checkout in checkouts:
            checkout.close()
        for name, found_ratios in turns.items():
            ratios[name].append(statistics.median(found_ratios))
    return ratios


def quartiles(ratios: list[float]) -> list[float]:
    """The lower one, the median, the upper one."""
    return statistics.quantiles(ratios, n=4, method="inclusive") if len(ratios) > 1 else ratios * 3


def main() -> None:
    """Prints the ratios."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.against")
    parser.add_argument("checkout", type=Path, help="another checkout of metaid")
    parser.add_argument("--rounds", type=int, default=12, help="new processes of each checkout (default: 12)")
    parser.add_argument("--parts", nargs="+", choices=sorted(FIGURES), default=sorted(FIGURES), help="which benchmarks")
    arguments = parser.parse_args()
    rows: list[Row] = []
    for part in arguments.parts:
        ratios = compare(arguments.checkout.resolve(), part, arguments.rounds)
        for name in sorted(ratios):
            lower, median, upper = quartiles(ratios[name])
            rows.append({"figure": name, "this ÷ other": median, "quartiles": f"{lower:.3f} to {upper:.3f}"})
    print(table(rows))


if __name__ == "__main__":
    main()
