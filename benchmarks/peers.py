"""metaid beside every other way to identify a chain, at equal seconds of motion of the same rig with the same fault.

    python -m benchmarks.peers                                       # everything, two chains of each length
    python -m benchmarks.peers --part coarse --links 3 --seeds 0 1   # one question
    python -m benchmarks.peers --results FILE                        # goes on where it was stopped

Chains and wrong nominal models are those of `chains.py`. metaid pushes the rig; the others drive it along exciting
trajectories. All have the same sensors, and know the torques that were commanded and no others. `rivals` has the
methods, `rivals/conditions.py` what is wrong with the rig.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path

from threadpoolctl import threadpool_limits

from benchmarks.common import resumed
from benchmarks.rivals.answers import print_answers, tuned
from benchmarks.rivals.comparing import BUDGETS, METHODS, Cell, measure, wanted
from benchmarks.rivals.conditions import CONDITIONS
from benchmarks.rivals.picture import save

LINKS = (2, 3, 5)
SHOWN = 3  # links, in the picture


def main() -> None:
    """Measures what is not in the file yet, and prints a table for each question."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", nargs="+", choices=list(CONDITIONS), default=list(CONDITIONS), help="what is wrong")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--links", type=int, nargs="+", default=list(LINKS), help="numbers of links")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1], help="of the chains")
    parser.add_argument("--budgets", type=int, nargs="+", default=list(BUDGETS), help="seconds of motion")
    parser.add_argument("--results", type=Path, help="a file of finished runs, which is read and added to")
    parser.add_argument("--report", action="store_true", help="measure nothing, print all that is in the file")
    parser.add_argument("-o", "--output", type=Path, help="a PNG of error against seconds of motion, of three links")
    parser.add_argument("--json", action="store_true", help="every single result")
    given = parser.parse_args()
    if given.report:
        if given.results is None:
            parser.error("--report needs --results FILE")
        cells = [Cell(**json.loads(line)) for line in given.results.read_text().splitlines()]
    else:
        runs = wanted(given.part, given.methods, given.links, given.seeds, given.budgets)
        with threadpool_limits(1):
            cells = resumed(Cell, runs, measure, describe, given.results)
    if given.output:
        save(tuned(cells), SHOWN if SHOWN in given.links else max(given.links), given.output)
    if given.json:
        print(json.dumps([asdict(cell) for cell in cells], indent=1))
    else:
        print_answers(cells)


def describe(cell: Cell) -> str:
    """A cell for the line of progress."""
    errors = ", ".join(f"{max(error.values()):.2%}" for error in cell.errors)
    return f"worst lump {errors} in {cell.motion:.1f} s of motion and {cell.cpu:.1f} s of computing {cell.verdict}"


if __name__ == "__main__":
    main()
