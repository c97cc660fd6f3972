"""metaid beside every other way to identify a rig, at equal seconds of motion of the same rig with the same fault.

    python -m benchmarks.peers                                       # everything, three chains of each length, two arms
    python -m benchmarks.peers --part coarse --links 3 --seeds 0 1   # one question
    python -m benchmarks.peers --part fine --links 6 7               # the arms: puma560 and pa10
    python -m benchmarks.peers --results FILE                        # goes on where it was stopped
    python -m benchmarks.peers --report                              # the tables of docs/peers.md, from what is kept
    python -m benchmarks.peers --again --links 2 --seeds 0           # measures these anew; are they what is kept?
    python -m benchmarks.peers --report --results FILE --keep        # keeps what is in FILE

Rigs are benches that share no code with any of them (`soak.bench`). Chains and wrong nominal models are those of
`chains.py`; arms are two that ship, their nominal models are drawn as `arms.py` draws them. metaid pushes the rig; the
others drive it along exciting trajectories. All have the same sensors, and know the torques that were commanded and no
others. `rivals` has the methods, `rivals/conditions.py` what is wrong with the rig. mujoco.sysid is not run for all of
it, and may compute for 20 s.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path

from threadpoolctl import threadpool_limits

from benchmarks.common import finished, keep
from benchmarks.rivals.answers import print_answers, tuned
from benchmarks.rivals.comparing import BUDGETS, METHODS, SEEDS, Cell, Run, measure_all, wanted
from benchmarks.rivals.conditions import CONDITIONS
from benchmarks.rivals.kept import differences, read_cells, write_cells
from benchmarks.rivals.picture import save

LINKS = (2, 3, 5, 6, 7)
SHOWN = 3  # links, in the picture, with all BUDGETS
FEWER = (5, 60)  # s of motion, of the others


def main() -> None:
    """Measures what is not in the file yet, and prints a table for each question."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", nargs="+", choices=list(CONDITIONS), default=list(CONDITIONS), help="what is wrong")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--links", type=int, nargs="+", default=list(LINKS), help="numbers of links; 6 and 7 are arms")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS), help="of the chains")
    parser.add_argument("--budgets", type=int, nargs="+", help="seconds of motion (default: 5, 60; of 3 links 15)")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--results", type=Path, help="a file of finished runs, which is read and added to")
    parser.add_argument("--report", action="store_true", help="measure nothing, print all that is in the file, or kept")
    parser.add_argument("--keep", action="store_true", help="keep these results as those that docs/peers.md states")
    parser.add_argument(
        "--again", action="store_true", help="compare with those that are kept; status 1 if one differs"
    )
    parser.add_argument(
        "-o", "--output", type=Path, help="a PNG of error against seconds of motion, of three links and the arms"
    )
    parser.add_argument("--json", action="store_true", help="every single result")
    given = parser.parse_args()
    budgets = {links: given.budgets or (BUDGETS if links == SHOWN else FEWER) for links in given.links}
    runs = wanted(given.part, given.methods, budgets, given.seeds)
    if given.again:
        sys.exit(repeat(runs, given.workers))
    if given.report:
        cells = list(finished(Cell, given.results).values()) if given.results else read_cells()
    else:
        cells = measured(runs, given.results, given.workers)
    if given.keep:
        write_cells(cells)
    if given.output:
        save(tuned(cells), SHOWN if SHOWN in given.links else max(given.links), given.output)
    if given.json:
        print(json.dumps([asdict(cell) for cell in cells], indent=1))
    else:
        print_answers(cells)


def repeat(runs: list[Run], workers: int) -> int:
    """Measures those of the `runs` anew that are kept, and prints which are otherwise; the exit status."""
    kept = {(cell.sampler, cell.links, cell.seed): cell for cell in read_cells()}
    anew = measured([run for run in runs if run in kept], None, workers)
    different = differences(list(kept.values()), anew)
    print("\n".join([*different, f"{len(anew)} results measured again, {len(different)} of them are not what is kept"]))
    return 1 if different else 0


def measured(runs: list[Run], results: Path | None, workers: int) -> list[Cell]:
    """The cells of all `runs`: those that are in the file of `results`, and those that are measured and added to it."""
    began, done = time.perf_counter(), finished(Cell, results)
    left = [run for run in runs if run not in done]
    with threadpool_limits(1):
        for number, cell in enumerate(_at_once(left, workers), 1):
            done[cell.sampler, cell.links, cell.seed] = cell
            print(f"{number}/{len(left)} {describe(cell)}", file=sys.stderr, flush=True)
            keep(cell, results)
    print(f"{len(left)} cells in {(time.perf_counter() - began) / 60.0:.1f} minutes", file=sys.stderr)
    return [done[run] for run in runs]


def _at_once(runs: list[Run], workers: int) -> Iterator[Cell]:
    """Measures in so many processes, in one all that needs the same recording."""
    together: defaultdict[tuple[str, int, int], list[Run]] = defaultdict(list)
    for run in runs:
        together[run[0].split(" / ")[0], *run[1:]].append(run)
    if workers == 1:
        yield from (cell for each in together.values() for cell in measure_all(each))
        return
    with ProcessPoolExecutor(workers, get_context("spawn"), threadpool_limits, (1,)) as pool:
        for ended in as_completed([pool.submit(measure_all, each) for each in together.values()]):
            yield from ended.result()


def describe(cell: Cell) -> str:
    """A cell for the line of progress."""
    errors = ", ".join(f"{max(error.values()):.2%}" for error in cell.errors)
    taken = f"{cell.motion:.1f} s of motion and {cell.cpu:.1f} s of computing"
    return f"{cell.sampler}, {cell.links}, seed {cell.seed}: worst lump {errors} in {taken} {cell.verdict}"


if __name__ == "__main__":
    main()
