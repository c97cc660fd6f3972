"""Logs of simulated rigs, well read and not: none may be `found` while something of it is far from the truth.

A case is a number; `python -m soak.logs 123` does one again and says what it was.

| | drawn from |
| --- | --- |
| rig | chains of 1 to 5 links of `benchmarks.chains`, the arms puma560 and scara; nominals wrong by up to 30 % |
| friction | none, or viscous and dry |
| read and sent | at 100, 200, 500 or 1,000 Hz, for 6 to 15 s; speeds in the log or not |
| angles | exact, with 0.1 or 1 mrad of noise, or in steps of an encoder |
| asked for | all terms of friction, or viscous and Coulomb; the delay found, or said to be 0 |
| fault | none, or one of `soak.log_rigs.FAULTS` |

Well posed is a log that is excited, with no fault and the delay found.
"""

from __future__ import annotations

import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from metaid.errors import MetaidError
from metaid.models import DEVIATIONS
from metaid.plant import MujocoPlant
from metaid.recorded import RecordedResult, estimate
from soak.common import SoakResult, soaked
from soak.log_rigs import BROKEN, MENDED, SEED, Case, Rig, draw, log_of, rig_of

LOGS = 100
HALF_WIDTHS, SLACK = 3.0, 1e-3  # further from the truth than so many half-widths and this share of it is far
WELL_POSED_MODEL = 0.9
PROCESSES = 2


@dataclass(frozen=True)
class Judged:
    """What became of a case: its `verdict`, "refused" where the log was, why, and what is far off."""

    case: Case
    verdict: str
    reasons: str
    far: tuple[str, ...] = ()
    known: int = 0
    unknowns: int = 0
    repairs: tuple[str, ...] = ()


def true_values(found: RecordedResult, rig: Rig) -> dict[str, float]:
    """The true unknowns by their names."""
    model = found.estimate.model
    if model.prior is None:
        plant = rig.plant
        assert isinstance(plant, MujocoPlant)
        true = plant.chain.lumps_of(("gravity", "coriolis", "inertia"))
        bodies = dict(zip(true.names, true.vector.tolist(), strict=True))
    else:
        bodies = dict(zip(model.prior.base.names, model.prior.base.of(rig.tree.parameters).tolist(), strict=True))
    between = "_" if model.prior is None else ""
    for i, (damping, dry) in enumerate(zip(rig.tree.damping.tolist(), rig.tree.coulomb.tolist(), strict=True), 1):
        bodies |= {f"damping{between}{i}": damping, f"coulomb{between}{i}": dry}
    return bodies


def far_off(found: RecordedResult, rig: Rig) -> tuple[str, ...]:
    """What is determined and lies further from the truth than both its deviations and SLACK allow."""
    true = true_values(found, rig)
    far = []
    for row in found.verdict.lumps[found.verdict.lumps["determined"]].to_dict("records"):
        right, half = true.get(row["name"], 0.0), DEVIATIONS * float(np.hypot(row["sd"], row["sd_systematic"]))
        missed = row["identified"] - right
        if not abs(missed) <= HALF_WIDTHS * half + SLACK * abs(right):
            far.append(f"{row['name']} {row['identified']:.5g}, true {right:.5g}, {abs(missed) / half:.1f} half-widths")
    return tuple(far)


def try_case(number: int) -> Judged:
    """Simulates the rig of that number, and looks at what its log is said to say."""
    case, random = draw(number), np.random.default_rng([SEED, number, 1])
    with tempfile.TemporaryDirectory(prefix="metaid-log-") as place:
        rig = rig_of(case, Path(place), random)
        path = Path(place) / "log.csv"
        log_of(case, rig, random).to_csv(path, index=False, float_format="%.9g")
        try:
            found = estimate(path, rig.believed, friction=case.friction, delay=case.delay)
        except MetaidError as refusal:
            return Judged(case, "refused", str(refusal))
    table = found.verdict.lumps
    return Judged(
        case,
        found.verdict.word,
        "; ".join(found.verdict.reasons),
        far_off(found, rig) if found.verdict.word == "found" or case.well_posed else (),
        int(table["determined"].sum()),
        len(table),
        tuple(repair.kind for record in found.records for repair in record.repairs),
    )


def run(scale: float) -> list[SoakResult]:
    """No confident error, what is well posed has a model, what is mended is said, and what is broken finds nothing."""
    promised = round(LOGS * scale)
    judged: list[Judged] = []

    def confident() -> tuple[int, list[str]]:
        # Forked from a process that other parts of the soak ran in, it would have their locks.
        with ProcessPoolExecutor(PROCESSES, mp_context=get_context("spawn")) as pool:
            judged.extend(pool.map(try_case, range(promised)))
        found = [each for each in judged if each.verdict == "found"]
        known = sum(each.known for each in found)
        print(
            f"  {len(found)} of {len(judged)} found, {known} of their {sum(each.unknowns for each in found)} unknowns"
        )
        return len(judged), [f"{_about(each)}: {', '.join(each.far)}" for each in judged if each.far]

    def well_posed() -> tuple[int, list[str]]:
        posed = [each for each in judged if each.case.well_posed]
        print(f"  {sum(each.verdict == 'found' for each in posed)} of {len(posed)} without a fault found")
        has_model = ("found", "approximate")
        missed = [f"{_about(each)}: {each.verdict}, {each.reasons}" for each in posed if each.verdict not in has_model]
        return len(posed), missed if len(missed) > (1.0 - WELL_POSED_MODEL) * len(posed) else []

    def broken_logs() -> tuple[int, list[str]]:
        broken = [each for each in judged if each.case.fault in BROKEN and each.case.plant != "1"]
        return len(broken), [f"{_about(each)}: {each.verdict}" for each in broken if each.verdict == "found"]

    def mended() -> tuple[int, list[str]]:
        every = [each for each in judged if each.case.fault in MENDED and each.verdict != "refused"]
        return len(every), [_about(each) for each in every if MENDED[each.case.fault] not in each.repairs]

    return [
        soaked("logs of rigs at random: none found while an unknown is far off", promised, confident),
        soaked(f"of those, without a fault: {WELL_POSED_MODEL:.0%} found or approximate", 0, well_posed),
        soaked("of those, broken: none found", 0, broken_logs),
        soaked("of those, mended: that is said", 0, mended),
    ]


def _about(judged: Judged) -> str:
    return f"{judged.case.number} ({judged.case.about})"


if __name__ == "__main__":
    for each in sys.argv[1:]:
        judged = try_case(int(each))
        print(
            judged.case.number,
            judged.case.about,
            judged.verdict,
            judged.known,
            judged.unknowns,
            judged.reasons,
            *judged.far,
            sep="\n   ",
        )
