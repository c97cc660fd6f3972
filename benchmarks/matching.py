"""How many trials and seconds it takes to match what was seen, by number of links: gravity, Coriolis, inertia lumps.

    python -m benchmarks.matching                                  # N = 1 to 10, ten chains each
    python -m benchmarks.matching --links 15 20 30 --seeds 0 1 2
    python -m benchmarks.matching --worst 1.0 --spread 0.6 --links 2 3 5
    python -m benchmarks.matching --compared frequency             # squares of the same motion, which carry no sign
    python -m benchmarks.matching --experiment oscillation --links 2 3 4

Chains are those of benchmarks/chains.py, the plant is MuJoCo, and no length is assumed. `rich`: 2N pushes of a study's
horizon; the first trial sends the nominal law with its gravity lumps raised by `--first`, every other one the estimate
from all trials before, or raised gravity lumps again where that does not explain what was seen. `oscillation`: two
small pushes, over-compensated candidates alone, 6 s each; frequencies are matched. A run ends when every lump is within
`--within` of the truth, which only this script looks at. Seconds are those of trials and fits, without set-up and
compilation.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict, dataclass
from statistics import median

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.chains import random_chain
from benchmarks.recovery import _spoil as spoil
from metaid.compiled import CompiledLoop
from metaid.episode import FALL_LIMIT, REACH, RICH_FALL_LIMIT, Episode, FallRule, natural_time, rich_pushes, window_ends
from metaid.estimation import Estimate, LogUnknowns, Motions, Quantity, WatchedTrial, fit, upright
from metaid.models import Array, Chain, Lumps
from metaid.plant import MujocoPlant, PlantSettings, chain_of
from metaid.study import HORIZON

LINKS = (1, 2, 3, 4, 5, 7, 10)
TIMESTEP = 0.002  # s; half of it from 25 links on, whose fastest motion it is too long for
SMALL, LONG = 0.1, 6.0  # rad/s of the fastest link and s of an oscillation
OVER = 1.6, 2.6  # gravity factors of the candidates that oscillate
OSCILLATION_WINDOWS = 7
EXPLAINED = 3.0  # a misfit below this: the next fit may start from the estimate


@dataclass(frozen=True)
class Match:
    """One chain: the worst relative `errors` of any lump after each fit, from how many `trials` the last one was, and
    its misfit; how many unknowns it has, trials that ended in a fall, and seconds.
    """

    links: int
    unknowns: int
    seed: int
    errors: list[float]
    trials: int
    misfit: float
    falls: int
    trial_seconds: float
    fit_seconds: float


@dataclass(frozen=True)
class Experiment:
    """What is done to each chain; see the module."""

    name: str = "rich"
    compared: Quantity = "speed"
    first: float = 1.5
    worst: float = 0.3
    spread: float = 0.3
    within: float = 1e-6
    most: int = 4
    restarts: int | None = None

    def most_restarts(self, links: int) -> int:
        """Of a fit that ended in a wrong minimum: fewer, the dearer they are."""
        return max(20 // links, 2) if self.restarts is None else self.restarts

    @property
    def fewest(self) -> int:
        """Trials before the first fit: under one law small oscillations do not tell a chain from a heavier one."""
        return 2 if self.name == "oscillation" else 1

    def episode(self, plant: MujocoPlant, nominal: Chain, seed: int) -> Episode:
        """The pushes of every trial."""
        if self.name == "oscillation":
            pushes = rich_pushes(plant, 2, SMALL, seed)
            steps = round(LONG / plant.timestep)
            ends = window_ends(steps, OSCILLATION_WINDOWS, 0.5 ** (OSCILLATION_WINDOWS - 1))
            return Episode(pushes, steps, FallRule(FALL_LIMIT), window_ends=ends)
        steps = round(HORIZON * natural_time(nominal, plant.gravity) / plant.timestep)
        pushes = rich_pushes(plant, 2 * plant.njoint, REACH / (steps * plant.timestep), seed)
        return Episode(pushes, steps, FallRule(RICH_FALL_LIMIT), window_ends=window_ends(steps))

    def law(self, nominal: Lumps, estimate: Estimate | None, random: np.random.Generator) -> Lumps:
        """What the next trial sends: never an estimate that does not explain what was seen."""
        if self.name == "oscillation":
            return _over_compensating(nominal, random.uniform(*OVER, nominal.nlink))
        if estimate is None:
            return _over_compensating(nominal, self.first)
        if estimate.misfit < EXPLAINED:
            return estimate.lumps
        return _over_compensating(nominal, random.uniform(*OVER, nominal.nlink))


def match(links: int, seed: int, experiment: Experiment) -> Match:
    """Identifies one chain."""
    true, believed = random_chain(links, seed)
    power = float(np.log1p(experiment.worst) / np.log1p(0.3))
    nominal = chain_of(tuple(spoil(*pair, power) for pair in zip(true, believed, strict=True)))
    plant = MujocoPlant("chain", PlantSettings(links=true, timestep=TIMESTEP if links < 25 else TIMESTEP / 2))
    episode = experiment.episode(plant, nominal, seed)
    compiled = CompiledLoop(plant, episode)
    starts = np.array([plant.start_speeds(start) for start in episode.starts])
    unknowns = LogUnknowns(nominal.lumps, plant.gravity, spread=experiment.spread)
    truth = unknowns.log_factors(plant.chain.lumps)
    random = np.random.default_rng([links, seed])
    trials: list[WatchedTrial] = []
    errors: list[float] = []
    spent = {"trials": 0.0, "fits": 0.0}
    estimate: Estimate | None = None
    while len(trials) < experiment.most and not (errors and errors[-1] <= experiment.within):
        began = time.perf_counter()
        law = experiment.law(nominal.lumps, estimate, random)
        trials.append(_trial(compiled, law, starts))
        ended = time.perf_counter()
        spent["trials"] += ended - began
        if len(trials) < experiment.fewest:
            continue
        start = estimate.unknowns if estimate is not None and estimate.misfit < EXPLAINED else None
        comparison = Motions(trials, unknowns, experiment.compared)
        estimate = fit(comparison, start, experiment.most_restarts(links))
        spent["fits"] += time.perf_counter() - ended
        errors.append(float(np.abs(np.expm1(estimate.searched.design @ (estimate.unknowns - truth))).max()))
    falls = sum(not trial.seen(len(trial.ends)).all() for trial in trials)
    misfit = np.nan if estimate is None else estimate.misfit
    return Match(links, len(unknowns.names), seed, errors, len(trials), misfit, falls, spent["trials"], spent["fits"])


def _trial(compiled: CompiledLoop, law: Lumps, starts: Array) -> WatchedTrial:
    windows = compiled.run(law).windows
    assert windows is not None
    return WatchedTrial(law, compiled.plant.timestep, upright(starts), windows)


def _over_compensating(nominal: Lumps, factors: Array | float) -> Lumps:
    """The nominal law with its gravity lumps raised by these `factors` (nlink)."""
    raised = np.ones(len(nominal.vector))
    raised[: nominal.nlink] = factors
    return nominal.scaled(raised)


def table(rows: list[Match], within: float) -> str:
    """The results as a Markdown table: how many chains were within, by the trials that their estimate is from."""
    counts = sorted({row.trials for row in rows})
    heading = ["links", "unknowns", "chains", *(f"from {count} trial{'s' * (count > 1)}" for count in counts)]
    heading += ["worst error", "falls", "ms of trials", "ms of fits", "ms of both", "slowest, ms"]
    lines = [f"| {' | '.join(heading)} |", "| --- " * len(heading) + "|"]
    for links in sorted({row.links for row in rows}):
        runs = [row for row in rows if row.links == links]
        reached = [sum(row.errors[-1] <= within and row.trials <= count for row in runs) for count in counts]
        cells = [str(links), str(runs[0].unknowns), str(len(runs)), *map(str, reached)]
        cells += [f"{max(row.errors[-1] for row in runs):.1e}", str(sum(row.falls for row in runs))]
        both = [row.trial_seconds + row.fit_seconds for row in runs]
        cells += [f"{1e3 * median(getattr(row, f'{what}_seconds') for row in runs):.1f}" for what in ("trial", "fit")]
        cells += [f"{1e3 * median(both):.1f}", f"{1e3 * max(both):.1f}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Runs what is asked for, with a line on stderr for every chain, and prints the table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, nargs="+", default=list(LINKS), help="numbers of links")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(10)), help="of the chains")
    parser.add_argument("--experiment", choices=["rich", "oscillation"], default="rich")
    parser.add_argument("--compared", choices=["speed", "frequency", "both"])
    parser.add_argument("--first", type=float, default=1.5, help="gravity factors of the first trial: 1 is the nominal")
    parser.add_argument("--worst", type=float, default=0.3, help="by how much a nominal mass may be wrong: 1 is 100 %%")
    parser.add_argument("--spread", type=float, default=0.3, help="what is believed of a log factor beforehand")
    parser.add_argument("--within", type=float, help="relative error of the worst lump at which a run ends")
    parser.add_argument("--most", type=int, help="trials")
    parser.add_argument("--restarts", type=int, help="of a fit that ended in a wrong minimum")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    oscillates = given.experiment == "oscillation"
    experiment = Experiment(
        given.experiment,
        given.compared or ("frequency" if oscillates else "speed"),
        given.first,
        given.worst,
        given.spread,
        given.within or (1e-4 if oscillates else 1e-6),
        given.most or (10 if oscillates else 4),
        given.restarts,
    )
    rows = []
    with threadpool_limits(1):
        match(2, 1000, experiment)  # compiles
        for links in given.links:
            for seed in given.seeds:
                rows.append(row := match(links, seed, experiment))
                errors = ", ".join(f"{error:.1e}" for error in row.errors)
                print(f"N={links} seed {seed}: {errors}; {row.fit_seconds:.3f} s of fits", file=sys.stderr)
    print(json.dumps([asdict(row) for row in rows], indent=2) if given.json else table(rows, experiment.within))


if __name__ == "__main__":
    main()
