"""What the nominal model's metric saves over plain factors, and how wrong the nominal model may be.

    python -m benchmarks.nominal
    python -m benchmarks.nominal --links 3 --seeds 0 1 --samplers cmaes --json

Chains and nominal models are those of benchmarks/chains.py, the nominal errors raised to a power so that masses and
inertias are wrong by up to the given share. Bounds are 0.2 to 5 where it is more than 30 %. `trials` is what it took
to bring the worst lump within 1 %.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import asdict
from statistics import median

from threadpoolctl import threadpool_limits

from benchmarks.recovery import Recovery, recover

WRONG = (0.1, 0.3, 0.6, 1.0)
MOST_TRIALS = 6000
METRIC, PLAIN = "nominal-metric", "plain"
COMBINATIONS = (("cmaes", METRIC), ("cmaes", PLAIN), ("tpe", METRIC), ("tpe", PLAIN))
MOST_TPE_TRIALS = 500


def main() -> None:
    """Runs the comparison and prints its table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, nargs="+", default=[2, 3, 5])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4])
    parser.add_argument("--wrong", type=float, nargs="+", default=list(WRONG))
    parser.add_argument("--samplers", nargs="+", default=["cmaes", "tpe"])
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    results: dict[tuple[int, float, str, str], list[Recovery]] = {}
    with threadpool_limits(1):
        for links in given.links:
            for wrong in given.wrong:
                power = math.log1p(wrong) / math.log1p(0.3)
                for sampler, coordinates in COMBINATIONS:
                    if sampler not in given.samplers:
                        continue
                    most = MOST_TPE_TRIALS if sampler == "tpe" else MOST_TRIALS
                    print(f"{links} links, {wrong:.0%}, {sampler}, {coordinates}", file=sys.stderr)
                    results[links, wrong, sampler, coordinates] = [
                        recover(links, seed, sampler, 2, coordinates, spoiled=power, most_trials=most)
                        for seed in given.seeds
                    ]
    if given.json:
        rows = [
            {"wrong": wrong, "coordinates": coordinates, **asdict(run)}
            for (_, wrong, _, coordinates), runs in results.items()
            for run in runs
        ]
        print(json.dumps(rows, indent=2))
    else:
        print(table(results))


def table(results: dict[tuple[int, float, str, str], list[Recovery]]) -> str:
    """Medians over the chains, as a Markdown table."""
    lines = [
        "| links | nominal wrong by | sampler | coordinates | within 1 % | trials to 1 % | final error |",
        "| --- " * 7 + "|",
    ]
    for (links, wrong, sampler, coordinates), runs in results.items():
        got = [run.trials_1 for run in runs if run.trials_1 is not None]
        trials = f"{median(got):,.0f}" if len(got) > len(runs) / 2 else "–"
        error = median(run.final_error for run in runs)
        cells = [str(links), f"{wrong:.0%}", sampler, coordinates, f"{len(got)} of {len(runs)}", trials, f"{error:.2%}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
