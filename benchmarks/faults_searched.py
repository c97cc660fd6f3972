"""How well faults of a plant are found beside the lumps, where a study searches them and does not know them.

    python -m benchmarks.faults_searched
    python -m benchmarks.faults_searched --faults delay tilt --chains 20
    python -m benchmarks.faults_searched --faults all

Chains of three links (`benchmarks/chains.py`), nominal models that are wrong by 30 %, four trials of `output-error`,
one fault at a time or `all` of them at once. Without noise, and with 1 mrad on the angles and no speed sensor. Each row
has the largest error of the fault and of a lump over the chains that were found, and how many of the true values their
95 % intervals hold.
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.chain_study import chain_study
from benchmarks.chains import random_chain
from benchmarks.common import made
from metaid.results import summary
from metaid.study import run_study

LINKS, TRIALS = 3, 4
NOISES = {0.0: {}, 1e-3: {"angle_noise": 1e-3, "speed_sensor": False}}
ROUNDING = 1e-9  # a relative error below which what is left is rounding, which differs by processor
OFFSETS, GAINS = (0.02, -0.01, 0.03), (1.0, 1.05, 0.93)  # rad; and of each motor
# What is searched, the faults of the plant, and what each link has: delay in steps of 2 ms.
CASES: dict[str, tuple[tuple[str, ...], dict[str, Any], dict[str, float]]] = {
    "delay": (("delay",), {"delay": 4}, {}),
    "tilt": (("tilt",), {"tilt": 0.03}, {}),
    "viscous": (("viscous",), {}, {"damping": 0.02}),
    "spring": (("spring",), {}, {"stiffness": 0.3}),
    "offset": (("offset",), {"encoder_offset": OFFSETS}, {}),
    "gain": (("gain",), {"torque_gain": GAINS}, {}),
    "all": (
        ("delay", "offset", "viscous", "spring", "gain"),
        {"delay": 4, "encoder_offset": OFFSETS, "torque_gain": GAINS},
        {"damping": 0.02, "stiffness": 0.3},
    ),
}


@dataclass(frozen=True)
class Searched:
    """One study: whether its verdict is `found`; the largest `error` of a fault and the size of that, in its unit; the
    largest relative error of a lump; how many of all values are inside their intervals, and how many there are.
    """

    fault: str
    noise: float
    seed: int
    found: bool
    error: float
    size: float
    unit: str
    lump_error: float
    inside: int
    values: int


def search(fault: str, noise: float, seed: int) -> Searched:
    """Runs the study of one chain."""
    kinds, faults, changes = CASES[fault]
    searched = {"faults": list(kinds)}
    spec = chain_study(random_chain(LINKS, seed), TRIALS, seed, {**faults, **NOISES[noise]}, changes, searched)
    with made(spec) as (store, name):
        run_study(store, name, workers=1)
        shown = summary(store, name)
    rows = [*shown["faults"], *shown["lumps"]]
    if shown["verdict"] != "found":
        return Searched(fault, noise, seed, False, np.inf, np.nan, "", np.inf, 0, len(rows))
    worst = max(shown["faults"], key=lambda row: abs(row["error"] / row["true"]))
    inside = sum(row["low"] <= row["true"] <= row["high"] for row in rows)
    error, size = abs(worst["error"]), abs(worst["true"])
    return Searched(fault, noise, seed, True, error, size, worst["unit"], float(shown["max_error"]), inside, len(rows))


def table(rows: list[Searched]) -> str:
    """The results as a Markdown table, with the worst of all chains."""
    lines = ["| searched | angle noise | chains | found | fault, worst | lumps, worst | inside 95 % |"]
    lines.append("| --- " * 7 + "|")
    for fault in CASES:
        for noise in NOISES:
            own = [row for row in rows if (row.fault, row.noise) == (fault, noise)]
            if not own:
                continue
            found = [row for row in own if row.found]
            if not found:
                lines.append(f"| `{fault}` | {1e3 * noise:g} mrad | {len(own)} | 0 | – | – | – |")
                continue
            worst = max(found, key=lambda row: row.error / row.size)
            share = sum(row.inside for row in found) / sum(row.values for row in found)
            lumps = max(row.lump_error for row in found)
            of_fault = f"{worst.error:.2g} of {worst.size:.3g} {worst.unit}".removesuffix(" 1")
            shown = [
                f"below {ROUNDING:.0e}" if error < ROUNDING else text
                for error, text in ((worst.error / worst.size, of_fault), (lumps, f"{lumps:.1e}"))
            ]
            # Without noise the intervals are those of rounding, and nothing is told by them.
            inside = f"{share:.0%}" if noise else "–"
            name, said = f"`{fault}`", f"{1e3 * noise:g} mrad" if noise else "none"
            lines.append(f"| {name} | {said} | {len(own)} | {len(found)} | {' | '.join(shown)} | {inside} |")
    return "\n".join(lines)


def main() -> None:
    """Runs what is asked for and prints the table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--faults", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--chains", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="seed")
    parser.add_argument("--results", type=Path, help="a file of finished studies, which are not run again")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    logging.disable()
    rows: dict[tuple[str, float, int], Searched] = {}
    if given.results is not None and given.results.exists():
        done = (Searched(**json.loads(line)) for line in given.results.read_text().splitlines())
        rows = {(row.fault, row.noise, row.seed): row for row in done}
    wanted = [
        (fault, noise, seed)
        for fault in given.faults
        for noise in NOISES
        for seed in range(given.first, given.first + given.chains)
    ]
    with threadpool_limits(1):
        for key in wanted:
            if key in rows:
                continue
            rows[key] = row = search(*key)
            print(f"{row.fault} {row.noise:g} seed {row.seed}: error {row.error:.2g}", file=sys.stderr, flush=True)
            if given.results is not None:
                with given.results.open("a") as file:
                    file.write(json.dumps(asdict(row)) + "\n")
    chosen = [rows[key] for key in wanted]
    print(json.dumps([asdict(row) for row in chosen], indent=2) if given.json else table(chosen))


if __name__ == "__main__":
    main()
