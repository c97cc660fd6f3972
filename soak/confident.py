"""Studies at random, well posed and not: none may say `found` while a lump is far from the truth.

A case is a number; `python -m soak.confident 123` does one again and says what it was.

| | drawn from |
| --- | --- |
| links | 1 to 4, of `benchmarks.chains` |
| sampler | all of them |
| measure | `spectral`, `count`, `crossing`; `smoothed` on noisy plants |
| trials | 3 to 200 |
| bounds | the default, or so narrow that they may exclude the truth |
| estimate | made, or in one of five studies not; one of five takes up faults by itself |
| plant | ideal; noisy sensors and pushes; or with a fault that the model does not know |

Well posed is a study that makes an estimate, of a plant without a hidden fault, with at least six trials of pushes
whose measure sees every lump.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.chains import random_chain
from metaid.errors import MetaidError
from metaid.plant import FaultSettings, PlantSettings
from metaid.results import judge, read_snapshot
from metaid.search import SAMPLERS
from metaid.store import Store
from metaid.study import StudySettings, StudySpec, create_study, run_study
from soak.common import SoakResult, soaked

STUDIES = 500
SEED = 11
HALF_WIDTHS, SLACK = 3.0, 1e-3  # further from the truth than so many half-widths and this share of it is far
WELL_POSED_FOUND = 0.95
PROCESSES = 2
HIDDEN: tuple[dict[str, Any], ...] = (
    {"links": {"damping": 0.05}},
    {"links": {"frictionloss": 0.05}},
    {"links": {"stiffness": 0.5}},
    {"faults": {"tilt": 0.03}},
    {"faults": {"torque_limit": 3.0}},
    {"faults": {"delay": 4}},
)
NOISE: dict[str, Any] = {"angle_noise": 1e-3, "speed_sensor": False, "push_noise": 0.02}


@dataclass(frozen=True)
class Case:
    """A study by its `spec`, whether it is `well_posed`, and in words what it is `about`."""

    spec: StudySpec
    well_posed: bool
    about: str


def draw(number: int) -> Case:
    """The case of that number; it may contradict itself."""
    random = np.random.default_rng([SEED, number])
    nlink = int(random.integers(1, 5))
    true, nominal = random_chain(nlink, int(random.integers(1000, 1_000_000)))
    noisy, hidden = bool(random.random() < 0.3), random.random() < 0.35
    fault = HIDDEN[random.integers(len(HIDDEN))] if hidden else {}
    faults = FaultSettings(**(NOISE if noisy else {}), **fault.get("faults", {}))
    links = tuple(link.model_copy(update=fault.get("links", {})) for link in true)
    measure = "smoothed" if noisy else str(random.choice(["spectral", "spectral", "crossing", "count"]))
    sampler = str(random.choice(sorted(SAMPLERS)))
    trials = int(random.integers(3, 200 if nlink < 3 else 60))
    estimated = bool(random.random() < 0.8) or sampler == "output-error"
    search: dict[str, Any] = {}
    if random.random() < 0.3:
        search = {"low": float(random.uniform(0.6, 0.95)), "high": float(random.uniform(1.05, 1.5))}
    settings: dict[str, Any] = {
        "plant": "drawn",
        "nominal": "drawn",
        "sampler": sampler,
        "trials": trials,
        "seed": number,
        "workers": 1,
        "search": search,
        "episode": {"measure": measure},
        "estimate": {"enabled": estimated},
    }
    # Drawn last, so that all else of a case is what it was before this was drawn.
    takes_up = estimated and bool(random.random() < 0.2)
    if takes_up:
        settings["estimate"]["faults"] = "proposed"
    plant = PlantSettings(links=links, faults=faults)
    spec = StudySpec(
        name=f"case-{number}", plant_name="drawn", plant=plant, nominal=nominal, study=StudySettings(**settings)
    )
    about = f"{nlink} links, {sampler}, {measure}, {trials} trials, {'noisy' if noisy else 'ideal'}"
    about += f", hidden {fault}" if hidden else ""
    about += "" if estimated else ", no estimate"
    about += ", faults taken up" if takes_up else ""
    about += f", bounds {search}" if search else ""
    well_posed = not hidden and estimated and trials >= 6 and measure in ("spectral", "smoothed")
    return Case(spec, well_posed, about)


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
    with tempfile.TemporaryDirectory(prefix="metaid-confident-") as folder:
        try:
            with closing(Store(str(Path(folder) / "metaid.db"), create=True)) as store:
                create_study(store, case.spec)
                run_study(store, case.spec.name)
                verdict = judge(read_snapshot(store, case.spec.name))
        except MetaidError as refusal:
            return Judged(case, None, str(refusal))
    far = tuple(far_lumps(verdict.lumps)) if verdict.is_found else ()
    missed = case.well_posed and not verdict.is_found
    return Judged(case, verdict.word, "; ".join(verdict.reasons) if missed or tells_why else "", far)


def far_lumps(lumps: pd.DataFrame) -> Iterator[str]:
    """The lumps of a table that lie further from the truth than their interval and SLACK allow."""
    for lump in lumps[lumps["determined"]].to_dict("records"):
        half_width = 0.5 * (lump["high"] - lump["low"])
        if not abs(lump["identified"] - lump["true"]) <= HALF_WIDTHS * half_width + SLACK * abs(lump["true"]):
            yield f"{lump['name']} {lump['error']:+.2%} where ±{half_width / abs(lump['true']):.2%} is said"


def run(scale: float) -> list[SoakResult]:
    """Two promises: no confident error, and that what is well posed is found."""
    promised = round(STUDIES * scale)
    judged: list[Judged] = []

    def confident() -> tuple[int, list[str]]:
        # Forked from a process that other parts of the soak ran in, it would have their locks.
        with ProcessPoolExecutor(PROCESSES, mp_context=get_context("spawn")) as pool:
            judged.extend(_enough(pool, promised))
        return len(judged), [
            f"{each.case.spec.name} ({each.case.about}): {', '.join(each.far)}" for each in judged if each.far
        ]

    def found() -> tuple[int, list[str]]:
        posed = [each for each in judged if each.case.well_posed]
        missed = [each for each in posed if each.verdict != "found"]
        failures = [f"{each.case.spec.name} ({each.case.about}): {each.verdict}: {each.reasons}" for each in missed]
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
