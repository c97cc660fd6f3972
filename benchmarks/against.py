"""Whether a change has cost speed: the engine's and the study's figures of this checkout over those of another.

python -m benchmarks.against CHECKOUT [--rounds N]

The two checkouts take turns, so that what slows the machine slows both. A row is a figure of the tables that
`benchmarks.engine` and `benchmarks.study` print, each a ratio to a peer of the same run: bare `mj_step`, or plain
Optuna. It is the median over rounds of this checkout's figure over the other's: above 1 this one is faster.
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
FIGURES = {"engine": ("mj_step ÷ bare", "direct ÷ bare", "analytic ÷ bare"), "study": ("metaid is faster by",)}


def figures(checkout: Path, benchmark: str) -> dict[str, float]:
    """What one run of a benchmark prints, by row and column."""
    command = [sys.executable, "-m", f"benchmarks.{benchmark}", "--json"]
    environment = {**os.environ, "PYTHONPATH": str(checkout)}
    ran = subprocess.run(command, cwd=checkout, env=environment, check=True, capture_output=True, text=True)
    tables = {title: rows for title, rows in json.loads(ran.stdout).items() if title != "machine"}
    return {
        f"{benchmark}: {_row_name(row)}, {column}": row[column]
        for rows in tables.values()
        for row in rows
        for column in row
        if column in FIGURES[benchmark]
    }


def _row_name(row: Row) -> str:
    return " ".join(str(value) for value in row.values() if isinstance(value, str)) or f"{row['links']} links"


def main() -> None:
    """Prints the ratios."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.against")
    parser.add_argument("checkout", type=Path, help="another checkout of metaid")
    parser.add_argument("--rounds", type=int, default=3, help="runs of each (default: 3)")
    parser.add_argument("--parts", nargs="+", choices=sorted(FIGURES), default=sorted(FIGURES), help="which benchmarks")
    arguments = parser.parse_args()
    ratios: dict[str, list[float]] = defaultdict(list)
    for _ in range(arguments.rounds):
        for part in arguments.parts:
            ours, theirs = figures(HERE, part), figures(arguments.checkout.resolve(), part)
            for name in ours.keys() & theirs.keys():
                ratios[name].append(ours[name] / theirs[name])
    print(table([{"figure": name, "this ÷ other": statistics.median(ratios[name])} for name in sorted(ratios)]))


if __name__ == "__main__":
    main()
