"""Studies at random, well posed and not: none may say `found` while a lump is far from the truth.

A case is a number (`soak.random_studies`); `python -m soak.confident 123` does one again and says what it was. Half of
the plants are benches that share no code with metaid, half of the robots are arms.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.bench_truth import true_arm, true_base, true_chain, true_lumps
from metaid.errors import MetaidError
from metaid.models import Array
from metaid.results import read_snapshot
from metaid.store import Store
from metaid.study import create_study, load_study, run_study
from soak.bench.serving import bench
from soak.common import SoakResult, soaked
from soak.random_studies import Case, draw, write

STUDIES = 500
HALF_WIDTHS, SLACK = 3.0, 1e-3  # further from the truth than so many half-widths and this share of it is far
ROUNDING = 1e-6  # SI: of a parameter that is nearly nothing
WELL_POSED_FOUND = 0.95
PROCESSES = 2


@dataclass(frozen=True)
class Judged:
    """What became of a case: its `verdict`, None where the study was refused, the `reasons` where a well-posed one was
    not found, one was refused, or they were asked for, and the lumps that are far off.
    """

    case: Case
    verdict: str | None
    reasons: str
    far: tuple[str, ...] = ()


def try_case(number: int, tells_why: bool = False) -> Judged:
    """Creates the study of that number, runs it, and looks at what it says it found, and at why if that `tells_why`."""
    case = draw(number)
    with tempfile.TemporaryDirectory(prefix="metaid-confident-") as name, ExitStack() as open_until_then:
        folder = Path(name)
        address = None
        if case.bench is not None:
            write(case, folder)
            plant = folder / ("bench.toml" if case.arm is None else "arm.xml")
            address = open_until_then.enter_context(bench(plant, case.timestep, **case.bench))
        path = write(case, folder, address)
        store = open_until_then.enter_context(closing(Store(str(folder / "metaid.db"), create=True)))
        try:
            create_study(store, load_study(str(path)))
            run_study(store, case.name)
            verdict = (snapshot := read_snapshot(store, case.name)).verdict
        except MetaidError as refusal:
            return Judged(case, None, str(refusal))
        lumps = verdict.lumps
        if case.bench is not None and snapshot.estimate is not None:
            lumps = lumps.assign(true=_of_bench(case, snapshot.problem.robot, list(lumps["name"]), folder))
    far = tuple(far_lumps(lumps)) if verdict.is_found else ()
    missed = case.well_posed and not verdict.is_found
    return Judged(case, verdict.word, "; ".join(verdict.reasons) if missed or tells_why else "", far)


def _of_bench(case: Case, robot: Any, names: list[str], folder: Path) -> Array:
    """The true lumps or base parameters of a bench, by the `robot` of a study."""
    has = case.bench or {}
    if case.arm is not None:
        return true_base(true_arm(folder / "arm.xml", has), robot.prior, has)
    return true_lumps(true_chain(case.links, has), names, has)


def far_lumps(lumps: pd.DataFrame) -> Iterator[str]:
    """The lumps of a table that lie further from the truth than their interval and SLACK allow."""
    for lump in lumps[lumps["determined"]].to_dict("records"):
        half_width, true = 0.5 * (lump["high"] - lump["low"]), lump["true"]
        off = abs(lump["identified"] - true)
        if not off <= HALF_WIDTHS * half_width + SLACK * abs(true) + ROUNDING:
            yield f"{lump['name']} {lump['identified']:.5g} ± {half_width:.2g} where {true:.5g} is true"


def run(scale: float) -> list[SoakResult]:
    """Two promises: no confident error, and that what is well posed is found."""
    promised = round(STUDIES * scale)
    judged: list[Judged] = []

    def confident() -> tuple[int, list[str]]:
        # Forked from a process that other parts of the soak ran in, it would have their locks.
        with ProcessPoolExecutor(PROCESSES, mp_context=get_context("spawn")) as pool:
            judged.extend(_enough(pool, promised))
        return len(judged), [
            f"{each.case.name} ({each.case.about}): {', '.join(each.far)}" for each in judged if each.far
        ]

    def found() -> tuple[int, list[str]]:
        posed = [each for each in judged if each.case.well_posed]
        missed = [each for each in posed if each.verdict != "found"]
        failures = [f"{each.case.name} ({each.case.about}): {each.verdict}: {each.reasons}" for each in missed]
        return len(posed), failures if len(missed) > (1.0 - WELL_POSED_FOUND) * len(posed) else []

    return [
        soaked("random studies, none of them confidently wrong", promised, confident),
        soaked("well-posed ones among them, at least 95 % of them found", 1, found),
    ]


def _enough(pool: ProcessPoolExecutor, promised: int) -> Iterator[Judged]:
    """As many cases as are promised, each told as it ends; those that were refused do not count."""
    done, numbers = 0, count()
    while done < promised:
        batch = [next(numbers) for _ in range(promised - done)]
        for each in pool.map(try_case, batch, chunksize=4):
            if each.verdict is not None:
                done += 1
                print(f"{done} of {promised}: {each.case.name}, {each.verdict}", *each.far, sep="; ", flush=True)
                yield each


def main() -> None:
    """Tries one case again."""
    judged = try_case(int(sys.argv[1]), tells_why=True)
    print(judged.case.about, judged.verdict, judged.reasons, *judged.far, sep="\n")


if __name__ == "__main__":
    main()
