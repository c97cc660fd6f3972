"""Which candidates the runaway rule stops on short rich pushes, how early, and whether it spares the truth.

    python -m benchmarks.runaway
    python -m benchmarks.runaway --links 3 --candidates 1000 --multiples 4 5 6

Chains are those of benchmarks/chains.py, pushes and horizon those of a study. A candidate has each lump, drawn
independently of the others, between 0.2 and 2 times the true one, or within a tenth or three tenths of it; such lumps
need not be those of any chain.
"""

from __future__ import annotations

import argparse
from statistics import median

import numpy as np

from benchmarks.chains import random_chain
from benchmarks.common import Row, table
from metaid.compiled import Objective
from metaid.models import Array
from metaid.plant import PlantSettings, chain_of
from metaid.study import EpisodeSettings, Problem, StudySettings, StudySpec

RANGES = {"0.2 to 2": (0.2, 2.0), "within 0.3": (0.7, 1.3), "within 0.1": (0.9, 1.1), "the truth": (1.0, 1.0)}


def objective(links: int, seed: int, multiple: float) -> tuple[Objective, Array]:
    """What evaluates candidates of one chain under the rule with that `multiple`, and the true factors (nlump)."""
    true, nominal = random_chain(links, seed)
    episode = EpisodeSettings(fall_runaway=multiple)
    study = StudySettings(plant="chain", nominal="chain", sampler="cmaes", trials=1, seed=seed, episode=episode)
    plant = PlantSettings(links=true)
    problem = Problem(StudySpec(name="chain", plant_name="chain", plant=plant, nominal=nominal, study=study))
    return problem.make_objective(), chain_of(true).lumps.vector / problem.chain.lumps.vector


def stopped(links: int, seeds: int, candidates: int, multiple: float, factors: tuple[float, float]) -> Row:
    """How many of the candidates whose lumps are times `factors`, least and largest, are stopped, and after which share
    of their steps.

    Args:
        links: of the chains.
        seeds: how many chains.
        candidates: of each chain; of the truth alone there is one.
        multiple: of the fastest link's speed after the push.
        factors: between which lumps are drawn.
    """
    shares, count = [], 0
    for seed in range(seeds):
        evaluated, truth = objective(links, seed, multiple)
        drawn = np.random.default_rng([links, seed]).uniform(*factors, (candidates, len(truth)))
        for lumps in drawn if factors[0] < factors[1] else drawn[:1]:
            outcome = evaluated.evaluate(lumps * truth)
            count += 1
            if outcome.fell:
                shares.append(outcome.steps / evaluated.episode.total_steps)
    return {"stopped": f"{len(shares) / count:.1%}", "after": f"{median(shares):.0%}" if shares else "–"}


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, nargs="+", default=[1, 2, 3, 5], help="numbers of links")
    parser.add_argument("--seeds", type=int, default=10, help="how many chains of each")
    parser.add_argument("--candidates", type=int, default=200, help="of each chain")
    parser.add_argument("--multiples", type=float, nargs="+", default=[3.0, 5.0, 10.0])
    given = parser.parse_args()
    rows: list[Row] = []
    for multiple in given.multiples:
        for links in given.links:
            row: Row = {"multiple": multiple, "links": links}
            for name, factors in RANGES.items():
                found = stopped(links, given.seeds, given.candidates, multiple, factors)
                row[f"{name}: stopped"] = found["stopped"]
                if name == "0.2 to 2":
                    row["after, of its steps"] = found["after"]
            rows.append(row)
    print(table(rows))


if __name__ == "__main__":
    main()
