"""What a study says of a plant with a fault that the model has not, however small the fault is.

    python -m benchmarks.hidden_faults
    python -m benchmarks.hidden_faults --studies 60 --first 1000

Chains of one to four links (`benchmarks/chains.py`) with a milliradian of noise are matched in three trials. Those of
even seeds are simulated, the others are on the bench that shares no code with metaid (`soak.bench`). Most have a fault
of random size: friction, a spring, a tilt, a torque limit, late torques. No study takes one up. The table has, for
clean plants and for each fault, how many studies are `found`, and how many `approximate`; how many of those are
confidently wrong, with a lump further from the truth than three half-widths of its interval and 0.1 %; and how many are
`not found`. Below it is how many intervals of what is approximate hold the truth.
"""

from __future__ import annotations

import argparse
import json
import logging
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.bench_truth import true_lumps
from benchmarks.chain_on_bench import made_on_bench
from benchmarks.chain_study import chain_study
from benchmarks.chains import random_chain
from benchmarks.common import made
from benchmarks.common import table as markdown
from metaid.plant import PlantSettings, chain_of
from metaid.results import read_snapshot
from metaid.study import StudySpec, run_study

# The largest size of each fault, and over how many powers of ten below it sizes are drawn.
OF_LINKS = {"damping": (0.02, 3.0), "frictionloss": (0.02, 3.0), "stiffness": (0.3, 3.0)}
OF_PLANT = {"tilt": (0.03, 2.5), "torque_limit": (16.0, 1.5)}
HIDDEN = {
    "damping": f"viscous friction up to {OF_LINKS['damping'][0]:g} N m s",
    "frictionloss": f"dry friction up to {OF_LINKS['frictionloss'][0]:g} N m",
    "stiffness": f"a spring up to {OF_LINKS['stiffness'][0]:g} N m/rad",
    "tilt": f"a tilt up to {1e3 * OF_PLANT['tilt'][0]:g} mrad",
    "torque_limit": "a torque limit of 0.5 to 16 N m",
    "delay": "torques 1 to 3 steps late, which the file of a simulated plant says",
    "none": "nothing",
}
KINDS = tuple(HIDDEN)
COLUMNS = (
    "hidden in the plant",
    "studies",
    "`found`",
    "of these wrong",
    "`approximate`",
    "wrong of those",
    "`not found`",
)
HALF_WIDTHS, SLACK = 3.0, 1e-3


@dataclass(frozen=True)
class Judged:
    """What became of one study: its `verdict`, whether it is confidently `wrong`, how many of its `known` lumps have
    intervals that hold the truth, and the largest error of these.
    """

    seed: int
    links: int
    fault: str
    misfit: float
    verdict: str
    wrong: bool
    held: int
    known: int
    error: float


def drawn(seed: int) -> tuple[StudySpec, str]:
    """The study of that seed, and its fault."""
    random = np.random.default_rng([77, seed])
    chain = random_chain(int(random.integers(1, 5)), int(random.integers(1000, 1_000_000)))
    fault = str(random.choice(KINDS))
    changes: dict[str, Any] = {}
    faults: dict[str, Any] = {"angle_noise": 1e-3, "speed_sensor": False, "push_noise": float(random.choice([0, 0.02]))}
    if fault == "delay":
        faults[fault] = int(random.integers(1, 4))
    elif fault != "none":
        largest, powers = (OF_LINKS | OF_PLANT)[fault]
        (changes if fault in OF_LINKS else faults)[fault] = largest * 10.0 ** -random.uniform(0.0, powers)
    return chain_study(chain, 3, seed, faults, changes, {"faults": []}), fault


def try_study(seed: int) -> Judged | None:
    """Runs the study of that seed; None where its trials show too little for an estimate."""
    spec, fault = drawn(seed)
    with (made_on_bench if seed % 2 else made)(spec) as (store, name):
        run_study(store, name)
        snapshot = read_snapshot(store, name)
        verdict, found = snapshot.verdict, snapshot.estimate
    if found is None:
        return None
    assert isinstance(spec.plant, PlantSettings)
    lumps = verdict.lumps.assign(true=true_lumps(chain_of(spec.plant.links), list(verdict.lumps["name"]), {}))
    known = lumps[lumps["determined"]]
    true, errors = known["true"], (known["identified"] - known["true"]).abs()
    allowed = HALF_WIDTHS * 0.5 * (known["high"] - known["low"]) + SLACK * true
    held = int(((known["low"] <= true) & (true <= known["high"])).sum())
    said = bool((errors > allowed).any()), held, len(known), float((errors / true).max() if len(known) else 0.0)
    return Judged(seed, len(spec.joints), fault, found.estimate.misfit, verdict.word, *said)


def table(rows: list[Judged]) -> str:
    """The results as a Markdown table."""
    shown = []
    for fault in KINDS:
        own = [row for row in rows if row.fault == fault]
        cells: list[Any] = [HIDDEN[fault], len(own)]
        for word in ("found", "approximate"):
            judged = [row for row in own if row.verdict == word]
            cells += [len(judged), sum(row.wrong for row in judged)]
        cells.append(sum(row.verdict == "not found" for row in own))
        shown.append(dict(zip(COLUMNS, cells, strict=True)))
    return markdown(shown)


def main() -> None:
    """Runs what is asked for and prints the table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--studies", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    logging.disable()
    with threadpool_limits(1):
        judged = [try_study(seed) for seed in range(given.first, given.first + given.studies)]
    rows = [row for row in judged if row is not None]
    if given.json:
        print(json.dumps([asdict(row) for row in rows], indent=2))
        return
    some = [row for row in rows if row.verdict == "approximate"]
    held, known = (sum(getattr(row, key) for row in some) for key in ("held", "known"))
    print(f"{table(rows)}\n\n{held} of {known} intervals of what is approximate hold the truth")


if __name__ == "__main__":
    main()
