"""Random chains by the study `three-link` with exact sensors: small pushes, counted periods, falls, a search, a match.

    python -m benchmarks.counted                                # N = 2 to 5, twenty chains each, cmaes and tpe
    python -m benchmarks.counted --links 3 --seeds 0 1 --samplers cmaes --json

Chains are those of benchmarks/chains.py. Each is a study of its own, run as a user runs it, in at most `--trials`
trials. A chain is found where the verdict is `found`; how wrong its lumps are, this script alone looks at. With
`--results FILE` finished runs are kept, and a stopped benchmark goes on.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

from benchmarks.chains import random_chain
from benchmarks.common import Row, made, resumed
from benchmarks.common import table as markdown
from metaid import results
from metaid.plant import PlantSettings
from metaid.study import load_study, run_study

STUDY = "three-link"
EXACT = {"episode.measure": "crossing", "episode.peak_speed": 0.1}  # what sensors without noise allow
WITHIN = 1e-3  # relative error of the worst lump


@dataclass(frozen=True)
class Searched:
    """One chain by one sampler.

    Attributes:
        sampler: that proposed the candidates.
        links: of the chain.
        seed: of the chain and of the study.
        lumps: how many there are, those of inertia included.
        verdict: on the study.
        error: the largest of a lump, relative; None where none was found.
        best_error: that of the best trial itself, of gravity and Coriolis lumps; None where nothing survived.
        known_from: the number of trials from which on the estimate stood; None where it took more than twelve.
        trials: in all.
        falls: of these.
        periods: counted in the others.
        idle: how many of the others had no whole period in any joint.
        seconds: of the run, and of all that is then said of it.
    """

    sampler: str
    links: int
    seed: int
    lumps: int
    verdict: str
    error: float | None
    best_error: float | None
    known_from: int | None
    trials: int
    falls: int
    periods: int
    idle: int
    seconds: float


def search(sampler: str, links: int, seed: int, trials: int) -> Searched:
    """One chain by one sampler, in so many `trials`."""
    true, nominal = random_chain(links, seed)
    spec = load_study(STUDY, {**EXACT, "sampler": sampler, "seed": seed, "trials": trials})
    spec = spec.model_copy(update={"plant_name": "chain", "plant": PlantSettings(links=true), "nominal": nominal})
    began = time.perf_counter()
    with made(spec) as (store, name):
        run_study(store, name)
        shown, frame = results.summary(store, name), results.trials_frame(store, name)
    seconds = time.perf_counter() - began
    counted = frame[frame["state"] == "COMPLETE"].filter(like="periods_").sum(axis=1)
    return Searched(
        sampler=sampler,
        links=links,
        seed=seed,
        lumps=len(shown["lumps"]),
        verdict=shown["verdict"],
        error=shown["max_error"],
        best_error=shown["best"].get("max_error"),
        known_from=(shown["estimate"] or {}).get("known_from"),
        trials=shown["trials"]["total"],
        falls=shown["trials"]["pruned"],
        periods=shown["periods"],
        idle=int((counted == 0).sum()),
        seconds=seconds,
    )


def table(rows: list[Searched]) -> str:
    """The results as a Markdown table; how early, periods and seconds are medians over chains."""
    lines: list[Row] = []
    for sampler, links in dict.fromkeys((row.sampler, row.links) for row in rows):
        runs = [row for row in rows if (row.sampler, row.links) == (sampler, links)]
        found = [row for row in runs if row.verdict == "found"]
        errors = [row.error for row in found if row.error is not None]
        known = [row.known_from for row in found if row.known_from is not None]
        best = [row.best_error for row in runs if row.best_error is not None]
        lines.append(
            {
                "sampler": sampler,
                "links": links,
                "lumps": runs[0].lumps,
                "chains": len(runs),
                "within 0.1 %": sum(error < WITHIN for error in errors),
                "found, but wrong": sum(error >= WITHIN for error in errors),
                "not found": len(runs) - len(found),
                "worst error": f"{max(errors):.0e}" if errors else None,
                "known from": median(known) if known else None,
                "at most": max(known) if len(known) == len(found) and known else None,
                "best trial itself": f"{median(best):.0%}" if best else None,
                "falls": f"{sum(row.falls for row in runs) / sum(row.trials for row in runs):.0%}",
                "periods": median(row.periods for row in runs),
                "seconds": f"{median(row.seconds for row in runs):.1f}",
            }
        )
    return markdown(lines)


def main() -> None:
    """Runs what is asked for, with a line on stderr for every finished run, and prints the table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, nargs="+", default=[2, 3, 4, 5], help="numbers of links")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(20)), help="of the chains")
    parser.add_argument("--samplers", nargs="+", default=["cmaes", "tpe"])
    parser.add_argument("--trials", type=int, default=60, help="of each chain")
    parser.add_argument("--results", type=Path, help="a file of finished runs, one JSON object a line")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    wanted = [(sampler, links, seed) for sampler in given.samplers for links in given.links for seed in given.seeds]

    def describe(row: Searched) -> str:
        return f"{row.verdict}, {'–' if row.error is None else f'{row.error:.0e}'}, {row.seconds:.1f} s"

    def measure(sampler: str, links: int, seed: int) -> Searched:
        return search(sampler, links, seed, given.trials)

    rows = resumed(Searched, wanted, measure, describe, given.results)
    print(json.dumps([asdict(row) for row in rows], indent=2) if given.json else table(rows))


if __name__ == "__main__":
    main()
