"""Studies at random, well posed and not: none may say `found` while a lump is far from the truth.

A case is a number (`soak.random_studies`); `python -m soak.confident 123` does one again and says what it was. Half of
the plants are benches that share no code with metaid, half of the robots are arms.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from metaid.errors import MetaidError
from metaid.models import Array
from metaid.plant import ArmPlant, PlantSettings, chain_of, load_plant
from metaid.results import Snapshot, judge, read_snapshot
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
            plant = folder / ("bench.toml" if case.arm is None else "bench.xml")
            address = open_until_then.enter_context(bench(plant, case.timestep, **case.bench))
        path = write(case, folder, address)
        store = open_until_then.enter_context(closing(Store(str(folder / "metaid.db"), create=True)))
        try:
            create_study(store, load_study(str(path)))
            run_study(store, case.name)
            verdict = judge(snapshot := read_snapshot(store, case.name))
        except MetaidError as refusal:
            return Judged(case, None, str(refusal))
        lumps = (
            verdict.lumps
            if case.bench is None or snapshot.estimate is None
            else verdict.lumps.assign(true=_of_bench(case, snapshot, folder))
        )
    far = tuple(far_lumps(lumps)) if verdict.is_found else ()
    missed = case.well_posed and not verdict.is_found
    return Judged(case, verdict.word, "; ".join(verdict.reasons) if missed or tells_why else "", far)


def _of_bench(case: Case, snapshot: Snapshot, folder: Path) -> Array:
    """The true lumps or base parameters of a bench, in units of what its first motor is told."""
    has = case.bench or {}
    unit = 1.0 + has.get("gains", (0.0,))[0]
    if case.arm is not None:
        assert snapshot.estimate is not None
        base = snapshot.estimate.estimate.searched.prior.base
        return np.asarray(base.of(_of_arm(has, folder)) / unit, dtype=np.float64)
    links = [dict(link) for link in case.links]
    links[0]["inertia"] += has.get("rotors", (0.0,))[0]  # the first rotor turns with the first link
    chain = chain_of(PlantSettings.model_validate({"links": links}).links)
    kinds = tuple(dict.fromkeys(str(name).partition("_")[0] for name in snapshot.problem.robot.estimated.names))
    return np.asarray(chain.lumps_of(kinds).vector_of(kinds) / unit, dtype=np.float64)


def _of_arm(has: Mapping[str, Any], folder: Path) -> Array:
    """The true parameters (njoint x 13) of a bench that is an arm."""
    plant = load_plant(folder / "arm.xml")
    assert isinstance(plant, ArmPlant)
    tree, added = plant.tree, np.zeros((3, plant.njoint))
    for row, name in enumerate(("rotors", "viscous", "dry")):
        given = has.get(name, ())
        added[row, : len(given)] = given
    rotor, damping, coulomb = added
    return replace(tree, rotor=tree.rotor + rotor, damping=tree.damping * 0.0 + damping, coulomb=coulomb).parameters


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
    """As many cases as are promised; those that were refused do not count."""
    done, numbers = 0, count()
    while done < promised:
        batch = [next(numbers) for _ in range(promised - done)]
        for each in pool.map(try_case, batch, chunksize=4):
            if each.verdict is not None:
                done += 1
                yield each


def main() -> None:
    """Tries one case again."""
    judged = try_case(int(sys.argv[1]), tells_why=True)
    print(judged.case.about, judged.verdict, judged.reasons, *judged.far, sep="\n")


if __name__ == "__main__":
    main()
