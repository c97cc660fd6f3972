"""What counting whole half periods determines: random chains by the settings of the study `two-link-counted`.

    python -m benchmarks.counting                                    # twenty chains each of two and three links
    python -m benchmarks.counting --links 2 3 5 --observables        # what each observable tells, minimised and matched
    python -m benchmarks.counting --links 2 --seeds 0 --cmaes 1000   # counts matched by CMA-ES over models: a minute

Chains are those of benchmarks/chains.py; the plant is MuJoCo; only this script looks at the truth. `exact`: a model
with exactly these counts was found, and its lumps are given. `within`: its worst lump is within 2 % (two links) or 5 %.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.chains import random_chain
from benchmarks.common import Row, table
from metaid.episode import Windows
from metaid.estimation import Experiment, WatchedTrial
from metaid.models import Array, Lumps
from metaid.paper.counting import Counts
from metaid.plant import PlantSettings, chain_of
from metaid.study import Problem, StudySpec, load_study

STUDY = "two-link-counted"
WITHIN = {2: 0.02}  # and 5 % of more links
MATCHED = {
    "count at the end": "count",
    "counts, 20 readings": "count",
    "Rice frequency": "frequency",
}
MINIMISED = {"count": "count", "crossings": "crossing", "Rice frequency": "spectral"}
OBSERVED = 3  # chains of each number of links that all observables are tried on
MINIMISING = 600  # trials of CMA-ES, that search and fall as in the study `three-link`
LIKE_THREE_LINK = {
    "sampler": "cmaes",
    "search.coordinates": "plain",
    "search.start": 1.4,
    "search.sigma": 0.2,
    "episode.fall_limit": 1.5708,
    "episode.fall_runaway": 5.0,
}


@dataclass(frozen=True)
class Match:
    """One chain: half periods counted, counts compared and how many of them differ in the end, the worst error of any
    lump, the widest half extent (both shares of the lump), whether the truth is within every extent, and seconds.
    """

    links: int
    seed: int
    half_periods: int
    counts: int
    differing: int
    worst_error: float
    half_extent: float | None
    covers: bool | None
    seconds: float


def problem_of(links: int, seed: int, **changes: object) -> Problem:
    """The settings of the study on a random chain, with `changes` by dotted key."""
    true, nominal = random_chain(links, seed)
    spec = load_study(STUDY, {"seed": seed, **changes})
    plant = PlantSettings(links=true)
    return Problem(StudySpec(name="chain", plant_name="chain", plant=plant, nominal=nominal, study=spec.study))


def true_lumps(problem: Problem) -> Lumps:
    """Those of the plant."""
    assert isinstance(problem.spec.plant, PlantSettings)
    return chain_of(problem.spec.plant.links).lumps


def watch(problem: Problem) -> tuple[Experiment, list[WatchedTrial]]:
    """The trials of the study, whose laws follow from its seed alone."""
    experiment, searcher, objective = problem.experiment(), problem.make_searcher(), problem.make_objective()
    assert experiment is not None
    trials = []
    random = np.random.default_rng(problem.spec.study.seed)
    factors: Array = searcher.ask()[0]
    for number in range(problem.spec.study.trials):
        trial = experiment.trial(factors, objective.evaluate(factors, number))
        if trial is not None:
            trials.append(trial)
        factors = factors.copy()
        factors[: problem.nominal.nlink] = random.uniform(1.6, 2.6, problem.nominal.nlink)
    return experiment, trials


def match(links: int, seed: int) -> Match:
    """Identifies one chain by counting."""
    problem = problem_of(links, seed)
    experiment, trials = watch(problem)
    truth = experiment.unknowns.log_factors(true_lumps(problem))
    began = time.perf_counter()
    found = experiment.estimate(trials)
    seconds = time.perf_counter() - began
    assert found is not None
    assert found.counts is not None
    half_periods = sum(int(trial.windows.half_periods[:, -1].sum()) for trial in trials)
    half = covers = None
    if found.extent is not None:
        half = float(0.5 * np.expm1(np.ptp(found.extent, axis=0)).max())
        true = found.searched.design @ truth
        covers = bool(((found.extent[0] <= true) & (true <= found.extent[1])).all())
    error = float(np.abs(np.expm1(found.searched.design @ (found.unknowns - truth))).max())
    return Match(links, seed, half_periods, found.counts, round(found.misfit), error, half, covers, seconds)


def summary(rows: list[Match]) -> list[Row]:
    """One row a number of links."""
    shown = []
    for links in sorted({row.links for row in rows}):
        runs = [row for row in rows if row.links == links]
        exact = [row for row in runs if not row.differing]
        within = [row for row in exact if row.worst_error <= WITHIN.get(links, 0.05)]
        shown.append(
            {
                "links": links,
                "chains": len(runs),
                "half periods": int(np.median([row.half_periods for row in runs])),
                "counts": runs[0].counts,
                "exact": len(exact),
                "within": len(within),
                "worst error, %": 100.0 * max((row.worst_error for row in exact), default=np.nan),
                "widest half extent, %": 100.0 * max((row.half_extent or np.nan for row in exact), default=np.nan),
                "truth inside": sum(bool(row.covers) for row in exact),
                "differing in others": ", ".join(str(row.differing) for row in runs if row.differing) or "–",
                "median s": float(np.median([row.seconds for row in runs])),
            }
        )
    return shown


def observables(links: int, seed: int) -> Iterator[Row]:
    """What each observable tells of one chain: the worst error of gravity, Coriolis and inertia lumps, in %."""
    for name, measure in MINIMISED.items():
        changes = {"trials": MINIMISING, "episode.measure": measure, "estimate.compare": "frequency"}
        problem = problem_of(links, seed, **LIKE_THREE_LINK, **changes)
        yield _row(links, name, "minimised", MINIMISING, _minimised(problem), problem)
    problem = problem_of(links, seed)
    experiment, trials = watch(problem)
    for name, compared in MATCHED.items():
        used = trials
        if name == "count at the end":
            used = [replace(trial, windows=_last(trial)) for trial in trials]
        comparing = problem_of(links, seed, **{"estimate.compare": compared}).experiment()
        found = None if comparing is None else comparing.estimate(used, thorough=False)
        explained = found is not None and found.is_explained
        values = found.lumps.vector_of(experiment.unknowns.kinds) if explained and found is not None else None
        yield _row(links, name, "matched", len(used), values, problem)


def observed(rows: list[Row]) -> list[Row]:
    """One row an observable and a number of links: in how many chains there is a result, and median errors of these."""
    heads = ("links", "observable", "how", "trials")
    shown = []
    for key in dict.fromkeys(tuple(row[head] for head in heads) for row in rows):
        runs = [row for row in rows if tuple(row[head] for head in heads) == key]
        found = [row for row in runs if row["gravity, %"] is not None]
        row = dict(zip(heads, key, strict=True)) | {"result": f"{len(found)} of {len(runs)}"}
        for name in ("gravity, %", "coriolis, %", "inertia, %"):
            errors = [each[name] for each in found if each[name] is not None]
            row[name] = float(np.median(errors)) if errors else None
        shown.append(row)
    return shown


def _last(trial: WatchedTrial) -> Windows:
    """The last window alone."""
    windows = trial.windows
    return replace(
        windows,
        ends=windows.ends[-1:],
        seen=(windows.seen == len(windows.ends)).astype(np.int64),
        motion=windows.motion[:, -1:],
        half_periods=windows.half_periods[:, -1:],
    )


def _minimised(problem: Problem) -> Array | None:
    """The lumps of the best survivor by CMA-ES, inertia lumps as the nominal model has them."""
    searcher, objective = problem.make_searcher(), problem.make_objective()
    best, value, tried = None, np.inf, 0
    while tried < MINIMISING:
        batch = searcher.ask()
        outcomes = [objective.evaluate(factors, tried + i) for i, factors in enumerate(batch)]
        searcher.tell(outcomes)
        tried += len(batch)
        for factors, outcome in zip(batch, outcomes, strict=True):
            if not outcome.fell and outcome.value < value:
                best, value = factors, outcome.value
    if best is None:
        return None
    return np.append(best * problem.chain.lumps.vector, problem.nominal.inertia_lumps)


def _row(links: int, name: str, how: str, trials: int, lumps: Array | None, problem: Problem) -> Row:
    kinds = ("gravity", "coriolis", "inertia")
    true = true_lumps(problem)
    row: Row = {"links": links, "observable": name, "how": how, "trials": trials}
    first = 0
    for kind in kinds:
        own = true.vector_of((kind,))
        told = lumps is not None and not (how == "minimised" and kind == "inertia")
        error = np.abs(lumps[first : first + len(own)] / own - 1.0).max() if told and lumps is not None else None
        row[f"{kind}, %"] = None if error is None else 100.0 * float(error)
        first += len(own)
    return row


def by_cmaes(links: int, seed: int, most: int) -> Row:
    """The counts matched by CMA-ES over models alone: the sum of differing half periods, from the nominal model."""
    import cmaes

    problem = problem_of(links, seed)
    experiment, trials = watch(problem)
    counts = Counts(trials, experiment.unknowns)
    truth = experiment.unknowns.log_factors(true_lumps(problem))
    optimizer = cmaes.CMA(mean=np.zeros(len(truth)), sigma=0.15, seed=seed + 1)
    best, at, tried, began = np.inf, np.zeros(len(truth)), 0, time.perf_counter()
    while tried < most and best > 0 and not optimizer.should_stop():
        told = []
        for _ in range(optimizer.population_size):
            z = optimizer.ask()
            shown = counts.counted(z, counts.stages, slopes=False)
            value = 1e9 if shown is None else float(np.abs(shown.shown - shown.seen).sum())
            told.append((z, value))
            if value < best:
                best, at = value, z
        tried += len(told)
        optimizer.tell(told)
    error = 100.0 * float(np.abs(np.expm1(experiment.unknowns.design @ (at - truth))).max())
    seconds = time.perf_counter() - began
    return {
        "links": links,
        "seed": seed,
        "off in all": int(best),
        "worst error, %": error,
        "models": tried,
        "s": seconds,
    }


def main() -> None:
    """Runs what is asked for, with a line on stderr for every chain, and prints the table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, nargs="+", default=[2, 3], help="numbers of links")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(20)), help="of the chains")
    parser.add_argument("--observables", action="store_true", help="what each observable tells, first three seeds")
    parser.add_argument("--cmaes", type=int, default=0, help="match by CMA-ES alone, with so many models at most")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    rows: list[Row] = []
    matches: list[Match] = []
    with threadpool_limits(1):
        compile_once()
        for links in given.links:
            if given.observables:
                for seed in given.seeds[:OBSERVED]:
                    for row in observables(links, seed):
                        print(row, file=sys.stderr, flush=True)
                        rows.append(row)
                continue
            for seed in given.seeds:
                if given.cmaes:
                    rows.append(by_cmaes(links, seed, given.cmaes))
                else:
                    matches.append(match(links, seed))
                    rows.append(asdict(matches[-1]))
                print(rows[-1], file=sys.stderr, flush=True)
    shown = summary(matches) if matches else observed(rows) if given.observables else rows
    print(json.dumps(rows, indent=2) if given.json else table(shown))


def compile_once() -> None:
    """Compiles, so that it is in no one's seconds."""
    experiment, trials = watch(problem_of(2, 1000, trials=2))
    experiment.estimate(trials)


if __name__ == "__main__":
    main()
