"""How many trials it takes to identify an arm, how exactly, and how long: seven arms, nominals that are far off.

    python -m benchmarks.arms                          # seven arms, ten seeds each
    python -m benchmarks.arms --noise 1e-4             # rad on the angles, and no sensor of speeds
    python -m benchmarks.arms --arms puma560 panda --seeds 0 1 2 --json
    python -m benchmarks.arms --results arms.jsonl     # goes on where it was stopped
    python -m benchmarks.arms --sampler cmaes --trials 2000 --seeds 0         # no twin: the value of each trial alone

Shipped arms are as they are. UR5, Panda, xArm7 and Kinova are the URDFs of `example-robot-data`, which `make robots`
installs. A URDF states no rotors, and most of these no friction: they get some, by their torque limits and the seed.
Masses and inertias of the nominal arm are wrong by up to 30 %, centres of mass by up to 15 %, rotors and friction are
believed to be nothing. A trial is 2 njoint coasts and njoint pushes on springs, 0.3 s each, from poses and speeds in
the joint ranges. The first has the law of the nominal arm, each other one that of the estimate from all before. Errors
are those of gravity torque, Coriolis torque and mass matrix (`metaid.models.tree.model_error`) after the last trial, of
those that were found. A `--sampler` that minimises is told the value of each trial and nothing else. `--smooth` takes
dry friction away.
Seconds are those of trials and fits, without compilation, of all threads together: two cores need half as long.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.arm_rigs import OTHERS, SHIPPED, URDFS, WITHIN, estimate_arm, experiment_on, plant_of, read_trial
from benchmarks.arms_minimised import MINIMISERS, minimise, minimised_table
from benchmarks.common import Row, table
from metaid.compiled import fastest_loop
from metaid.estimation import ArmEstimate, ArmLaws, BaseUnknowns, Loop, ReadTrial, WatchedTrial
from metaid.models.tree import ModelError, Tree, model_error
from metaid.plant import slope_weights

EXACT = 1e-8  # an error below which what is left is rounding, which differs by processor
ERRORS = {"gravity": "gravity torque", "coriolis": "Coriolis torque", "mass_matrix": "mass matrix"}


@dataclass(frozen=True)
class Identified:
    """One arm and seed: errors of the nominal model and after each trial, the misfits and whether they are explained,
    how many of the base parameters were inside their 95 % intervals after the last trial, pushes that fell, seconds.
    """

    arm: str
    seed: int
    joints: int
    unknowns: int
    nominal: ModelError
    errors: list[ModelError]
    misfits: list[float]
    explained: list[bool]
    inside: int
    falls: int
    seconds: float

    @property
    def trials_needed(self) -> int | None:
        """After how many trials all errors were within 1 %; None where they were not."""
        within = [number for number, error in enumerate(self.errors, 1) if error.largest <= WITHIN]
        return within[0] if within else None


def identify(name: str, seed: int, noise: float, trials: int) -> Identified:
    """Identifies an arm from a nominal that is far off.

    Args:
        name: of the arm.
        seed: of what is wrong, of the starts and of the noise.
        noise: of the angles, in rad.
        trials: at most; without noise one that coasts as an explained estimate says is the last.
    """
    plant = plant_of(name, seed, noise)
    true, n = plant.tree, plant.njoint
    prior, episode = experiment_on(plant, seed)
    nominal = prior.nominal
    began = time.process_time()
    searched = BaseUnknowns(prior)
    law = nominal.parameters
    loop = fastest_loop(plant, episode, law)
    estimate: ArmEstimate | None = None
    watched: list[WatchedTrial | ReadTrial] = []
    errors: list[ModelError] = []
    misfits: list[float] = []
    explained: list[bool] = []
    falls = 0
    spent = time.process_time() - began
    for number in range(trials):
        began = time.process_time()
        record = loop.run(law, number)
        falls += int(record.fell.sum())
        if record.readings is not None:
            read = Loop(plant.timestep, np.full(n, noise), slope_weights(plant.timestep))
            watched.append(read_trial(ArmLaws(searched, episode), law, read, record.readings))
        else:
            assert record.windows is not None
            watched.append(WatchedTrial(law, plant.timestep, episode.states, record.windows, episode.springs))
        before, estimate = estimate, estimate_arm(watched, searched, estimate)
        spent += time.process_time() - began
        if estimate is None:
            break
        law = estimate.parameters
        errors.append(model_error(true, law))
        misfits.append(estimate.misfit)
        explained.append(estimate.is_explained)
        if not noise and before is not None and before.is_explained and estimate.is_explained:
            break
    return Identified(
        arm=name,
        seed=seed,
        joints=n,
        unknowns=len(searched.names),
        nominal=model_error(true, nominal.parameters),
        errors=errors,
        misfits=misfits,
        explained=explained,
        inside=0 if estimate is None else _inside(estimate, true),
        falls=falls,
        seconds=spent,
    )


def _inside(estimate: ArmEstimate, true: Tree) -> int:
    """How many base parameters are inside their intervals."""
    low, high = estimate.interval_with(estimate.value_deviations)
    values = estimate.searched.prior.base.of(true.parameters)
    return int(((low <= values) & (values <= high)).sum())


def resumed(arms: list[str], seeds: list[int], noise: float, trials: int, path: Path | None) -> Iterator[Identified]:
    """Every arm from every seed, one after the other.

    Args:
        arms: their names.
        seeds: see `identify`.
        noise: see `identify`.
        trials: see `identify`.
        path: of a file of finished ones, one JSON object a line: what is in it is not run again, what is run is added.
    """
    done = {}
    if path is not None and path.exists():
        for text in path.read_text(encoding="utf-8").splitlines():
            row = json.loads(text)
            nominal, errors = ModelError(**row.pop("nominal")), [ModelError(**error) for error in row.pop("errors")]
            done[row.pop("noise"), row.pop("trials"), row["arm"], row["seed"]] = row, nominal, errors
    for name in arms:
        for seed in seeds:
            if (noise, trials, name, seed) in done:
                row, nominal, errors = done[noise, trials, name, seed]
                yield Identified(**row, nominal=nominal, errors=errors)
                continue
            found = identify(name, seed, noise, trials)
            if path is not None:
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"noise": noise, "trials": trials, **asdict(found)}) + "\n")
            yield found


def line(found: Identified) -> str:
    """A run for the line of progress."""
    last = found.errors[-1] if found.errors else None
    shown = f"{last.gravity:.1e} {last.coriolis:.1e} {last.mass_matrix:.1e}" if last else "none"
    after = " ".join(f"{error.largest:.1e}" for error in found.errors)
    verdict = "found" if found.explained and found.explained[-1] else "not found"
    return (
        f"{found.arm:9} {found.seed:3} {found.unknowns:3} unknown  nominal {found.nominal.largest:.2f}  {shown}  "
        f"({after})  misfit {found.misfits[-1] if found.misfits else np.nan:.2g}  {verdict}  "
        f"falls {found.falls}  {found.seconds:.1f} s"
    )


def identified_table(runs: Sequence[Identified], is_noisy: bool) -> str:
    """A row for each arm, and one for all."""
    rows = []
    for name in (*dict.fromkeys(run.arm for run in runs), ""):
        own = [run for run in runs if name in (run.arm, "")]
        found = [run for run in own if run.explained and run.explained[-1]]
        sizes = sorted({run.unknowns for run in own})
        wrong = [100.0 * run.nominal.largest for run in own]
        needed = [run.trials_needed for run in own if run.trials_needed]
        row: Row = {
            "arm": name or "all",
            "nominal arms": len(own),
            "base parameters": f"{sizes[0]} to {sizes[-1]}" if len(sizes) > 1 else sizes[0],
            "error of the nominal arm": f"{min(wrong):.0f} to {max(wrong):.0f} %",
            "found": len(found),
            "most trials to 1 %": max(needed) if len(needed) == len(own) else None,
        }
        for kind, shown in ERRORS.items():
            row[f"{shown}, median"] = _share(median(getattr(run.errors[-1], kind) for run in found)) if found else None
        row["largest of all"] = _share(max(run.errors[-1].largest for run in found)) if found else None
        if is_noisy:
            inside = sum(run.inside for run in found) / max(sum(run.unknowns for run in found), 1)
            row["inside 95 %"] = f"{100.0 * inside:.1f} %"
        row["seconds, median"] = round(median(run.seconds for run in own), 1)
        row["seconds, most"] = round(max(run.seconds for run in own), 1)
        rows.append(row)
    return table(rows)


def _share(error: float) -> str:
    return f"below {EXACT:.0e}" if error < EXACT else f"{100.0 * error:.2g} %"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--arms", nargs="+", default=[*SHIPPED, *URDFS], choices=[*SHIPPED, *OTHERS, *URDFS])
    parser.add_argument("--seeds", nargs="+", type=int, default=list(range(10)))
    parser.add_argument("--noise", type=float, default=0.0, help="of the angles, in rad; then without speed sensors")
    parser.add_argument("--trials", type=int, default=4, help="at most")
    parser.add_argument("--sampler", default="output-error", choices=["output-error", *MINIMISERS])
    parser.add_argument("--smooth", action="store_true", help="of a sampler that minimises: arms without dry friction")
    parser.add_argument("--results", type=Path, help="a file of finished runs, which are not run again")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if options.sampler != "output-error":
        searched = []
        with threadpool_limits(1):
            for name in options.arms:
                for seed in options.seeds:
                    one = minimise(name, seed, options.sampler, options.trials, options.noise, options.smooth)
                    print(f"{name} {seed}: {one.trials} trials", file=sys.stderr, flush=True)
                    searched.append(one)
        print(json.dumps([asdict(run) for run in searched]) if options.json else minimised_table(searched))
        return
    runs = []
    with threadpool_limits(1):  # threads of the linear algebra would only be in the way of the twins'
        identify(options.arms[0], options.seeds[0], options.noise, 1)  # compiles
        for run in resumed(options.arms, options.seeds, options.noise, options.trials, options.results):
            runs.append(run)
            print(line(run), file=sys.stderr, flush=True)
    if options.json:
        print(json.dumps([asdict(run) | {"trials_needed": run.trials_needed} for run in runs], indent=1))
    else:
        print(identified_table(runs, options.noise > 0.0))


if __name__ == "__main__":
    main()
